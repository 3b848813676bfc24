"""The report of a drive log. `report` writes the page, and `residuals` makes the figures and tables of residuals.

Start at `report.write_report`.
"""
