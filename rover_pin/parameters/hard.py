"""Ground that is no sand: the obstacle of Fig 7."""

import math

from rover_pin.contact import Soil

HARD_GROUND = Soil(c=0.0, phi=math.radians(35.0), k=1e-3, k_1=1e6, k_2=0.0, n=1.0)
"""A rock or board under a rubber wheel, in the same equations: hardly any sinkage (0.8 mm), full grip tan 35 deg after
1 mm of shear. Assumed: the paper says only that "in reality, the obstacle has a hard surface"."""
