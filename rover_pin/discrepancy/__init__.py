"""Decide which effects a model lacks, and return the verdict: the answer, its probabilities and its held-out errors.

The loop finds the effect that a model lacks. It fits the base model to measured data, computes the probability of each
set of missing causes (package `inference`), decides the answer, and tests the model with the added causes on data that
were not used for its fit. Start at `conclude.conclude`. This package knows no rover and no file format: each kind of
data is a class with the interface `question.LoopData`.
"""
