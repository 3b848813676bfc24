"""The report of a test bench: start at `report.write_report`."""
