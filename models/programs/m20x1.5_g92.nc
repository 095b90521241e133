O0003 (M20x1.5, external: one G92 block per cut, X is modal with F)
G97 S500 M3
T0303
G0 X26. Z6.
G92 X19.5 Z-30. F1.5
X19.1
X18.8
X18.55
X18.35
X18.2
X18.16
X18.16 (spring pass)
G0 X60. Z60.
M5
M30
