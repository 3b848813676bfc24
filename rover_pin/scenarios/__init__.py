"""Ready-made drives by name, every number in them open: `scenario` composes scene, model and controller.

Start at `scenario`; `catalogue` lists what there is, `road_check` asks whether a rover stands and moves.
"""
