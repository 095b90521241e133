(a scroll on a face, and a cone steeper than 45 degrees: the lead runs along X)
G97 S100 M3
G0 X100. Z2.
Z-1.
G32 X20. F5.
G0 Z2.
X100.
Z-1.
G32 X40. Z-11. F5.
G0 Z5.
M30
