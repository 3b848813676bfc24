"""Fitting, with no rover in it: parameters with priors, noise, least squares, intervals, profiles.

Start at `fit` (a model against an `Experiment`) or `problem` and `descent` (residuals with an exact Jacobian).
"""
