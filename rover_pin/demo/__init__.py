"""Data sets that one can answer, made with something hidden or nothing: a wheel rig, a drive log, slip against slope.

`hidden` says what may be hidden; `rig`, `drive_log` and `slip_slope` write a set each, and what they hid beside it.
"""
