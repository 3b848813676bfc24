"""Measured points for the fit of models, and the files that hold them.

There are three kinds of points: runs of a wheel rig, traction factors, and steady windows of a drive. Start at
`rig_reading.read_rig_set`, which returns a `rig_set.RigSet`. `foreign_rig` makes the files of such a data set from a
researcher's own table.
"""
