O0005 (two starts, lead 3, pitch 1.5: same Z, start angles half a turn apart)
G97 S400 M3
G0 X26. Z9.
X18.16
G32 Z-40. F3. Q0
G0 X26.
Z9.
X18.16
G32 Z-40. F3. Q180000
G0 X26.
Z9.
M5
M30
