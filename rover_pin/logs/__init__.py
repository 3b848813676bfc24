"""Drive logs: a folder with `drive.toml` and one table or ROS bag a run.

Start at `drive_log`; `importing` makes logs of recordings in other layouts.
"""
