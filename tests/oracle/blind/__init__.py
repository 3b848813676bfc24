"""A generator of drive logs with hidden effects, for blind tests. It uses NumPy only, imports nothing of rover_pin, and
computes many runs at once.

The last axis of every array is the run within a batch. `tree` reads the URDF, `bodies` sums spatial inertias in world
axes, `ground` divides the rim at the corners of the ground by antiderivatives (n = 1), and `soil` integrates Eqs
(2)-(7). `contact` and `motor` contain the laws with every hidden effect, and `rover` sums the forces. `drive`
integrates in time: half a drift of the pose, a Runge-Kutta-Chebyshev step of all else, half a drift. `sensors` adds the
errors of sensors, `campaign` draws the runs, `hidden` draws the hidden effects, and `sealed` writes data sets with
sealed answers.
"""
