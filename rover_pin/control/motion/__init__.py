"""Motions of the body: what wheels do for it (`kinematics`), and controls that hold them there. Start with `servo`."""
