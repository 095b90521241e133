O0004 (M20x1.5, external: G32, each pass written out)
G97 S500 M3
G0 X26. Z6.
X19.4
G32 Z-30. F1.5
G0 X26.
Z6.
X18.16
G32 Z-30.
G0 X26.
Z6.
M5
M30
