"""Sections that the report of any data has: each a function, see `report.section`."""
