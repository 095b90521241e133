O0009 (straight thread that runs out on a cone: a chain, only the first block waits and only its Q counts)
G97 S500 M3
G0 X26. Z6.
X18.4
G32 Z-20. F1.5 Q45000
G32 X21. Z-24. Q90000
G32 W-3. F2.
G0 X30.
M30
