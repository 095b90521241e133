(the log program g33_2start.ngc in shared words: the second start by a shift of Z)
G21 G18 G90 G40 G80
G0 X24 Z9
M3 S400
G4 X3
G0 X20
G33 Z-40 F3.0
G0 X24
Z10.5
G4 X0.211
G0 X20
G33 Z-40 F3.0
G0 X24
Z9
M5
M2
