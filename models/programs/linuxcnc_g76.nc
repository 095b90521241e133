(the log program g76.ngc in shared words: J0.2 -> Q200, K0.92 -> P920, Q29.5 -> a 59, H1 -> m 1 with d 0, E1.5 -> r 10)
G21 G18 G90 G40 G80
G0 X24 Z6
M3 S400
G4 X2
G76 P011059 Q0 R0
G76 X18.16 Z-30 P920 Q200 F1.5
G0 X24 Z6
M5
M2
