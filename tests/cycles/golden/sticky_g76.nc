(setup: dialect=gsk980tdi)
G97 S500 M3
G0 X20. Z5.
G76 P010060 Q80 R0.1
G76 X10. Z-20. P1299 Q400 F2.
G76 X10. Z-20. P1299 Q400 F2. (again, by the parameters alone)
M30
