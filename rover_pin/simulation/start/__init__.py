"""Where a drive begins: a rover set down on its terrain, brought to rest, and whether it stands there.

Start at `place`.
"""
