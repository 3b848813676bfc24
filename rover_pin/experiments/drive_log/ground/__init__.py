"""The ground of a log's runs as it may differ from the declared: how that moves them, and what they tell of it.

Start at `field`.
"""
