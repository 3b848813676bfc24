"""Slip estimates from sensors: from sensors on board by a particle filter, from a camera, or from a tracker next to the
test rig.

Start at `onboard_slip`. `ground` computes slopes and loads of the wheels from the rover's posture and its motors'
torques. `laws` defines how a particle of the filter changes and how the readings weigh it, `belief.c` is the filter,
and `stop` stops a rover that is stuck according to the filter.
"""
