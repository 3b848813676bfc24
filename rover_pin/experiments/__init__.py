"""What a loop is closed on: `wheel_rig`, `drive_log`, `slip_slope`, `motor_brake`; what is on no list (`unlisted`)."""
