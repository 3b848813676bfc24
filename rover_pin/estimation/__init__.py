"""Fitting without any rover: parameters with priors, noise, least squares, intervals of parameters and tests of
significance.

Start at `fit.fit` (fits a model to an `Experiment`), `residual.residual` (the residual and its chi2) or
`descent.descend` (minimises the sum of squares of residuals with a Jacobian).
"""
