"""The report of wheel-rig data sets. `report` writes the page, and `figures` draws channels and residuals.

Start at `report.write_report`.
"""
