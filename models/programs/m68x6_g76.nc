O0002 (M68x6, external: the example of the GSK sheets; X and Z of the end point, cuts with a decimal point are mm)
G97 S300 M3
G0 X80 Z10
G76 P020560 Q0.150 R0.1
G76 X60.64 Z-62 P3.68 Q1.8 F6
G0 X100 Z50
M30
