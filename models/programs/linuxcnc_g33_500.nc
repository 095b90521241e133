(the log program g33_500.ngc in shared words: X as diameter, dwell in X seconds, lead as F)
G21 G18 G90 G40 G80
G0 X24 Z6
M3 S500
G4 X3
G0 X20
G33 Z-40 F1.5
G0 X24
Z6
G4 X0.137
G0 X19.4
G33 Z-40 F1.5
G0 X24
Z6
M5
M2
