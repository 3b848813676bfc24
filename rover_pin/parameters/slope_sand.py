"""Sand on which Nexus 6 slips on slopes about as measured wheels do."""

import math
from dataclasses import dataclass

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar, Soil

DING = "chosen for a slip of 0.2 on 10 deg: Ding et al. 2011, Fig 9"


@dataclass(frozen=True)
class SlopeSand(Soil):
    """Firm dry sand: phi 41 deg, k 8 mm, else Table 1, on which Nexus 6 slips 0.22 on 10 deg and 0.36 on 15 deg.

    A steadily climbing wheel pulls its load times the tangent of the slope. By that the two wheels of
    `studies/data/ding-2011-*` (80 N, 315 mm; Ding et al. 2011, J. Terramechanics 48(1), Fig 9) slip 0.2 on 10.3 deg
    (smooth) and 14.0 deg (lugged), 0.3 on 10.6 and 15.4, and Nexus 6 on this sand 0.2 on 9.4 and 0.3 on 13.7. It slips
    more below (0.1 on 3.6 deg; they on 7.8 and 9.9). phi and k were chosen, not measured on one soil. Looser sands slip
    far more: the lugged wheel of `studies/data/cmu-grousered-wheel` 0.9 on 11 deg; on Table 1 nothing climbs 9 deg.
    """

    phi: Scalar = quantity(math.radians(41.0), "rad", DING, 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.008, "m", DING, 1e-5, 0.5, "k")
