"""The compiled step from Python's side: laws as generated C, numbers of rover and terrain, toolchain and its cache.

Start at `step`; `laws` and `body_law` are the CasADi functions that are compiled.
"""
