"""The slip as sensed: on board by a belief that knows when it stands, by a camera, by a tracker.

Start at `onboard_slip`; `ground` is what posture and torques say, `laws` how a particle moves and is weighed,
`belief.c` the rest.
"""
