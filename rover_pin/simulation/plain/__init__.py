"""The step, its contact law and the loop in plain NumPy and Pinocchio: slow, readable, the compiled step's reference.

Start at `step`.
"""
