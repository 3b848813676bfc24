"""Simulated drives: `simulate` drives a `model` under a controller and returns a `trace`.

`stepping` chooses the step size, `native` contains one time step in C, and `plain` contains this step in NumPy and
Pinocchio, which is slower but readable. `engines` lists which of them can compute a drive. `compiled` generates the C
code of the contact and motor laws, `start` sets the rover down on its terrain, and `outcome` summarises a finished
drive and checks whether it can be believed.

The functions of one drive, from the caller to the called function: `simulate.simulate`,
`stepping.tolerance.drive_to_tolerance`, `driving.run_compiled`, `native/loop.c`, `native/step.c`.
"""
