"""A drive log as an experiment: models are replayed on the runs of the log, and the predictions are compared with it.

Start at `experiment`.
"""
