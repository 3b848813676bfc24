"""The report of a drive log: start at `report.write_report`."""
