"""Reading and checking of a rover's two files, the URDF and the TOML, before a drive.

`tree` reads the URDF and `layout` the TOML, `joint_forms` rewrites the joints as drives need them, and `faults` lists
the faults of both files. `inertia_check`, `drawn_axis` and `cross_check` are parts of this check; `meshes` reads mesh
files.
"""
