"""Control of the body's motion: the wheel speeds and steering angles for a motion (`kinematics`), servos that hold
wheel speeds (`servo`), and routes of waypoints (`route`).
"""
