"""Runs of wheels on a rig, one set or several in one sand, as one experiment: model, checks, candidates, what is left.

Start at `experiment` and `model`; the data are `measurements.rig_set`.
"""
