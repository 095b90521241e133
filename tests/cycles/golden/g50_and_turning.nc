G50 X100. Z50. (where the tool stands)
G50 S2000
G96 S120 M3
G0 X30. Z2.
G90 X26. Z-40. F0.2
X22. R-0.5
G97 S500
G1 X20.
G98 G1 Z-5. F120
G50 U2. W1. (coordinates move)
G0 X30. Z6.
G92 X19. Z-20. F1.5 J0
G0 U10. W10.
M8
M0
M5
M30
G0 X0 Z0 (never reached)
