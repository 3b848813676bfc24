"""The trace of a drive: named channels with units over time, read from and written to files, and drawn.

Start at `trace`. `record` makes a trace from the rows of a drive, `channels` contains the names and units.
"""
