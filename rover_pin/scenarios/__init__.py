"""Ready-made drives by name. Every number of a drive can be changed.

Start at `scenario`, which joins terrain, model and controller. `scenes` holds the names, `catalogue` lists everything
that a user can choose, `sensitivities` computes the derivatives of a drive, and `road_check` checks whether the soil
carries a rover and whether the rover can move on it.
"""
