"""All influences that push on the rover apart from its motors, one effect in each file. The paper's own traction is one
of these effects.
"""
