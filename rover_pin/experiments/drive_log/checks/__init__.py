"""Checks of a drive log before anything is fitted to it: wrong units and signs, faulty sensors, missing manoeuvres.

`log` holds the tables of all checks and applies them. The checks themselves are in `channels` (single channels),
`motors` (wheels and motors), `pose` (the tracked pose) and `excitation` (the manoeuvres of all runs). `run_blocks`
computes the means over blocks of one second that the checks compare.
"""
