"""Exports that run outside the package: C code for a rover's computer, FMI units, the monitor of a rover, and MuJoCo
models.
"""
