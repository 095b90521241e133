O0008 (lead grows by 0.5 mm in every turn)
G97 S200 M3
G0 X30. Z5.
X24.
G34 Z-60. F2. R0.5
G0 X40.
M30
