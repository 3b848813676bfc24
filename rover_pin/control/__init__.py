"""Fig 9: slip estimates (`slip_estimate`, `onboard_slip`), `slip_control`, `torque_limit`, `bounds`, `tuning`."""
