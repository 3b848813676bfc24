"""The report of a joint fit of several rig sets: start at `report.write_report`."""
