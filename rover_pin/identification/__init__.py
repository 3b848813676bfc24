"""Soil constants from measured points: `identify`, its intervals and verdicts, the posterior.

Start at `identify`.
"""
