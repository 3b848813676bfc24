"""Gains found by optimisation: a global search, a gradient polish on a reduced model, the full rover's verdict.

Start at `tune`; what is tuned is declared in `study`.
"""
