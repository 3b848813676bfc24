"""One wheel-rig set, or several in one sand, as one experiment: one soil, one tuple of effects, each its own wheel.

Start at `sets` and `experiment`.
"""
