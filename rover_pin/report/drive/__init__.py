"""The report of a drive log. `report` writes the page, and `runs` and `residual` make its figures and tables.

Start at `report.write_report`.
"""
