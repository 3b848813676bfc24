"""Two of a kind side by side: verdicts, models or drives, as one table and one sentence.

Start at `compare.compare`.
"""
