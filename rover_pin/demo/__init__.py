"""Simulated data sets with a known truth, to try `close_the_loop` on: a wheel rig, a drive log, a recording as a logger
writes it, and slip against slope.

`hidden` lists the effects that a data set can hide. `rig`, `drive_log` (also for recordings) and `slip_slope` write the
data sets. Next to the folder of a data set they write a file with the truth: the hidden effect and the true soil.
"""

SETS = {"rig": "rig.toml", "drive-log": "drive.toml", "recording": "recording.csv", "slip-slope": "slope.toml"}
"""Kind of simulated data set -> the file that marks a folder as a data set of this kind."""
