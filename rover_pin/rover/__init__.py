"""The rover as a rigid multibody system in Pinocchio.

`rover` loads a rover from its files, `forward_dynamics` computes its accelerations, and `statics` computes its wheel
loads at rest. `driven_loads` computes the wheel loads of a measured drive, `wheel_base` computes the positions of the
wheels, and `urdf_check` checks a rover's files. `description` reads URDF and TOML, and `proposal` proposes the TOML for
a new URDF.
"""
