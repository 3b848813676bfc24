"""Fig 9 and beyond: slip estimates, slip control, torque bounds and checks, steering.

Start at `slip_control`; `bounds` are the traction-limited torques, `sensing/` tells the slip on board.
"""
