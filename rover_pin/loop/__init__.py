"""The loop closed: measured data against a model, the effect that it lacks, before and after.

Start at `close.close_the_loop`.
"""
