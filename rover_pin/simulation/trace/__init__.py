"""What a drive leaves: named channels with units over time, written to and read from files, and drawn.

Start at `trace`; `record` makes one from the rows of a drive.
"""
