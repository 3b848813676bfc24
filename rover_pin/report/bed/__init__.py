"""The report of a test bed: start at `report.write_report`."""
