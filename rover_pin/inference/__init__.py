"""Bayesian inference of the causes of a residual: the probability that each set of causes explains the data.

A cause is an effect that the model lacks, a wrong declared number, or an error of the measurement. A hypothesis is a
set of causes that act together, with or without a remaining discrepancy between model and data. This package knows no
rover: the data and the model come from an `Experiment`.

Two functions compute `Beliefs` (all hypotheses with their probabilities):

- Experiments with exact slopes (derivatives of the prediction by the parameters): `explore.py` fits each hypothesis.
  `error_model.py` defines the covariance of the errors, and `evidence.py` computes the evidence.
- Experiments without exact slopes: `discrepancy/search.py` fits few hypotheses, and `expansion.py` estimates the
  evidence of the others from a quadratic expansion about a fit.
"""
