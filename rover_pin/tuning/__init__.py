"""Tuning: find the gains of a slip control by optimisation, and test them on drives that the search has not used.

Start at `tune.tune_gains`. A `study.TuningStudy` states the gains to find and the drives. `improve.improve` does the
whole work from measured data to tuned gains.
"""
