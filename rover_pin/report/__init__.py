"""A verdict as a page: tables, figures, cautions of a rig's and of a drive log's.

Start at `page`.
"""
