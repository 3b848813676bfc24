"""Runs of a wheel on a rig, as an experiment: data, model, checks, candidates, verdict.

Start at `data` and `model`.
"""
