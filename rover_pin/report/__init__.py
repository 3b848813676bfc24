"""The report of a verdict as an HTML page with tables, figures and cautions.

A verdict is the result of the search for missing effects. `page` writes a page, `verdict_page` chooses its sections,
and `rig` and `drive` add the sections of wheel-rig data and of drive logs. Start at `page`.
"""
