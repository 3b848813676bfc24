"""Control of a rover's wheels: the slip control of the paper (Fig 9), torque bounds, servos, and slip estimates.

Start at `slip_control`. `torque_bounds` computes the torques that the soil can resist, `torque_check` limits the duty
so that the motors stay below these torques, `open_loop` has controllers without feedback, `motion` holds speeds and
drives routes, `sensing` estimates the slip on board, and `design` helps to write controllers of your own.
"""
