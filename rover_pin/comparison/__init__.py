"""Compare two verdicts, two models or two drives, and drive one scenario on several models or from places all over a
terrain.

Start at `compare.compare`.
"""
