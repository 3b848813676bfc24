"""What the loop can be closed on: `wheel_rig`, `drive_log`, and descriptions of what is on no list (`unlisted`)."""
