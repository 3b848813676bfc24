"""What a drive came to, and whether it is to be believed: outcome, energy account, error of the step.

Start at `outcome` and `audit`.
"""
