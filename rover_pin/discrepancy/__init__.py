"""What a model lacks, with no rover in it: candidates, score test, refits, cross-validation, the search and its answer.

Start at `search`; what it works on is `estimation.experiment.Experiment`.
"""
