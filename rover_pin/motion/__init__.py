"""Drives: a `model` (rover, soil, effects), `simulate` steps it in C (`native`; `plain` the same in NumPy), `trace`."""
