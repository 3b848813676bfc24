"""Measured points as evidence: wheel-rig runs, traction factors, steady windows of a drive, and their files.

Start at `rig_reading` and `rig_set`.
"""
