"""A generator of drive logs with hidden effects, for blind tests: NumPy alone, nothing of rover_pin, many runs at once.

Every array has the runs of a batch as its last axis. `tree` reads the URDF, `bodies` sums spatial inertias in world
axes, `ground` cuts the rim at the corners of the ground by antiderivatives (n = 1), `soil` integrates Eqs (2)-(7),
`contact` and `motor` hold the laws with every hidden effect, `rover` sums the forces, `drive` integrates: drift, a
Runge-Kutta-Chebyshev kick, drift. `sensors` reads, `campaign` draws runs, `hidden` what is hidden, `sealed` writes.
"""
