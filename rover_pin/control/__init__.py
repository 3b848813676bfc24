"""Fig 9 and beyond: slip estimates, slip control, torque bounds and checks, steering.

Start at `slip_control`; `bounds` are the traction-limited torques, `onboard_slip` senses without a camera.
"""
