"""A second rover simulator: plain NumPy, another formulation of everything, nothing of rover_pin.

`urdf` reads the tree, `bodies` sums link Jacobians into the equation of motion in minimal coordinates (the differential
is a mimic joint, not a constraint force), `rim` sums the contact over hundreds of rim points, `soil` integrates
Eqs (2)-(7) by the tanh-sinh rule, `physics` puts the forces together, `rest` finds the start, `drive` runs RK4.
"""
