"""Several rig sets in one sand, as one experiment: one soil, one tuple of effects, many wheels.

Start at `sets` and `experiment`.
"""
