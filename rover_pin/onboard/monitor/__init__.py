"""The monitor: an on-board forecast of the probability that a rover will be stuck or buried, and of the cause. Start at
`monitor`.
"""
