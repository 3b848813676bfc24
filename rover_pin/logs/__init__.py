"""Read, write and check drive logs.

A drive log is a folder with the file `drive.toml` and one table or ROS bag for each run. Start at `drive_log`. The room
`importing` converts recordings in other layouts to drive logs.
"""
