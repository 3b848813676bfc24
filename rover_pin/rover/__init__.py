"""The rigid rover in Pinocchio: `rover` loads it, `acceleration` is Eq (8), `statics` and `driven_loads` its loads.

`description` reads and checks URDF and TOML before anything moves; `proposal` guesses the TOML of a new URDF.
"""
