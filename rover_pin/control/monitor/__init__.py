"""The monitor: whether a rover will be stuck or buried within seconds, and why. Start at `monitor`."""
