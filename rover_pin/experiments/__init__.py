"""Experiments whose measured data the loop (the search for missing effects of a model) compares with the model: wheel
rigs, drive logs, slip against slope, `motor_brake` and `pendulum`. The package `unlisted` describes a residual that no
known effect explains.
"""
