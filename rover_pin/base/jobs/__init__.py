"""Long calculations: worker processes, a Dask cluster, the remaining time, and protection from code among the data.

Start at `cluster`.
"""
