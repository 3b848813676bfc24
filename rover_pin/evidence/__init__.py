"""Measured data in, soil parameters out, with what the data cannot tell.

Import from the modules: `traction_points` and `measurement` (the data), `fit` (`identify`), `posterior` (sampling).
"""
