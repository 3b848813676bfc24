"""A second rover simulator in plain NumPy, with another formulation of every part; imports nothing of rover_pin.

`urdf` reads the tree. `bodies` sums the Jacobians of the links into the equation of motion in minimal coordinates, in
which the differential is a coupled joint and not a constraint force. `rim` sums the contact over hundreds of points of
the rim, and `soil` integrates Eqs (2)-(7) by the tanh-sinh rule. `physics` adds the forces, `rest` finds the start, and
`drive` integrates by RK4.
"""
