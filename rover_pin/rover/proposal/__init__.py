"""A proposal for the TOML of a new rover, made from its URDF: the roles of joints, wheels and suspension.

Start at `new_rover`, which writes the TOML and marks each guess in it. `propose` finds the wheels and axles,
`wheel_shape` finds the sizes of the wheels, `frames` finds the direction of the front, and `suspension` finds the
pivots. `picture` draws the proposed rover, and `parts` defines the classes that describe it.
"""
