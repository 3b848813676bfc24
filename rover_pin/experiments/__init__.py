"""What a loop is closed on: rigs, drive logs, slopes, `motor_brake`, `pendulum`; what is on no list (`unlisted`)."""
