"""Gains found by optimisation: a global search, a polish on the full rover, and its verdict.

Start at `tune`; what is tuned is declared in `study`.
"""
