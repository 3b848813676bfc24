"""Logged drives of a rover, as an experiment: replayed models, features that are compared, candidates, verdict.

Start at `experiment`.
"""
