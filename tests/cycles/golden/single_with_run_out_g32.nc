(G32 with a run-out of its own, outside and inside)
G97 S500 M3
G0 X26. Z6.
X18.4
G32 Z-20. F1.5 J0.9 K1.5
G0 X30.
G0 X16. Z6.
G0 X20.
G33 W-20. F1.5 K1.
G0 X16.
M30
