"""Long work: worker processes, a cluster, the time left, and an environment that runs nothing from the working folder.

Start at `cluster`.
"""
