"""A proposal for the TOML of a new rover, made from its URDF: the roles of joints, wheels and suspension. Each guess is
marked in the TOML.

Start at `new_rover`, which writes the TOML. `propose` finds wheels and axles, `wheel_shape` their sizes, `frames` the
direction of the front, and `suspension` the pivots; `picture` draws the result, and `parts` defines the classes that
describe it.
"""
