"""Sections that the reports of all kinds of data have. Each function takes a verdict and returns a `page.Section`."""
