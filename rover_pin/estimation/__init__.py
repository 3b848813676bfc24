"""Fitting, with no rover in it: parameters with priors, noise, least squares, intervals, profiles.

Start at `fit` (a model against an `Experiment`) or `descent` (any rows with a Jacobian).
"""
