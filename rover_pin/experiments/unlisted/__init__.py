"""What acts that is on no list: an action times a regressor of measured signals, described and drafted as an effect.

Start at `residual`.
"""
