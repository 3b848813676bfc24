"""Tools for the design of a controller: a controller from a user's file, a drive that is simulated sample by sample, a
linear model at a trim point, and the package's laws as CasADi functions.
"""
