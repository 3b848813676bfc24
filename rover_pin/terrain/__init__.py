"""The ground: a height above every (x, y) and the soil there; shapes, files, and its cut by a wheel's plane.

Start at `terrain`; ready-made ones are in `shapes` and `field`.
"""
