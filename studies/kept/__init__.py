"""Stored cases of the blind tests, so that an interrupted run continues."""
