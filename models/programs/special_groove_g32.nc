(setup: indexing=every_block)
O0006 (groove whose inclination is zero in a part of each turn: every block waits for its own start angle)
G97 S60 M3
G0 X26. Z0.
X19.
G32 W-2. F4. Q0 (half a turn inclined, then the gate is shut to 270 degrees)
G32 W-1. F4. Q270000
G32 W0 F0 Q90000 (holds only)
G32 W-2. F4. Q180000
G0 X26.
M30
