O0007 (tapered external thread in inch, 14 threads per inch, taper 1 in 16)
G20 G97 S600 M3
G0 X1.2 Z0.2
G76 P010060 Q20 R0.001
G76 X0.96 Z-0.8 R-0.03125 P571 Q120 I14
G0 X2. Z1.
G21
M30
