"""What can be wrong with a drive log before anything is fitted: one idea a file.

Start at `log`.
"""
