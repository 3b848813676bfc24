"""Ready-made drives by name, in which every number can be changed.

Start at `scenario`, which joins terrain, model and controller. `scenes` holds the names, `catalogue` lists everything
that a user can choose, `sensitivities` computes the derivatives of a drive, and `road_check` checks whether a rover can
stand and move on its soil.
"""
