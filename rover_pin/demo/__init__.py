"""Data sets that one can answer, made with something hidden or nothing: a wheel rig, a drive log, slip against slope.

`hidden` says what may be hidden; `rig`, `drive_log` and `slip_slope` write a set each, and what they hid beside it.
"""

SETS = {"rig": "rig.toml", "drive-log": "drive.toml", "slip-slope": "slope.toml"}
"""The kinds, and the file that says of a folder what set is in it."""
