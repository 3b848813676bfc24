"""Read and check the two files of a rover, the URDF and the TOML, before a drive.

`tree` reads the URDF, and `layout` reads the TOML. `joint_forms` rewrites the joints into the form that drives need,
and `faults` lists the faults of both files. `inertia_check`, `drawn_axis` and `cross_check` are parts of this check.
`meshes` reads mesh files.
"""
