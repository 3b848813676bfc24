"""The report of a wheel-rig set: start at `report.write_report`."""
