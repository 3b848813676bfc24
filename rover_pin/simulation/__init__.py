"""Drives: `simulate` steps a `model`; `trace` holds what comes out, `outcome` says in a sentence what it came to.

`compiled` generates the step's laws, `native` is the step in C, `plain` the same in NumPy, `start` sets rovers down.
"""
