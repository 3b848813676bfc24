"""The TOML of a new rover, guessed from its URDF: roles of joints, wheels, suspension, each guess marked.

Start at `new_rover`.
"""
