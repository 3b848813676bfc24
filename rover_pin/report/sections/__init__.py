"""Sections that the report of any data has: each a class, see `report.section`."""
