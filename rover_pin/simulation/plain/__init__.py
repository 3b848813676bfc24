"""The step, its contact law and the loop of a drive in NumPy and Pinocchio: slow and readable. Tests compare the
compiled step with this code.

Start at `step`.
"""
