"""The step, its contact law and the loop of a drive in NumPy, with Pinocchio's algorithms: slow and readable. Tests
compare the compiled step with this code, and the engines `pinocchio-crba` and `pinocchio-aba` run it.

Start at `step`. `composite` (CRBA) and `articulated` (ABA) solve its equations of motion.
"""
