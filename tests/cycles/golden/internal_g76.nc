O1 (M30x2 internal: the tool leaves towards smaller X)
G97 S400 M3
G0 X24. Z5.
G76 P020060 Q80 R0.05
G76 U6. W-30. P1083 Q300 F2.
M30
