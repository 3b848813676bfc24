"""Beyond the paper: a desired slip that falls with the depth of the hole that a wheel has dug."""

from dataclasses import dataclass

import casadi as ca

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.effects.digging_memory import TOUCH, DiggingMemory


@dataclass(frozen=True)
class HoleLaw(Record):
    """S_d(D) = S_d - (S_d - S_deep) min(max((D / r - shallow) / (deep - shallow), 0), 1), for each wheel by itself.

    On firm ground the wheel may slip as thrust asks for; as its hole deepens it may slip less, and digs no further. D
    is estimated: `DiggingMemory` with what the wheel's slip and rim speed say, or what a `SlipEstimate` with a `hole`
    says. The lengths that S_d falls over scale with r, since a wheel counts as buried at r / 2.

    Source: none; the numbers are those of a search on drives of Nexus 6 (r = 45 mm: 4.5 and 9 mm). Differs from the
    paper: its S_d is constant.
    """

    S_deep: Scalar = quantity(0.1, "", "paper, section 5: its S_d, here of a deep hole", -1.0, 1.0, "S_d")
    shallow: Scalar = quantity(0.1, "", "tuned: depth over r at which S_d begins to fall", 0.0, 1.0, "D/r")
    deep: Scalar = quantity(0.2, "", "tuned: depth over r from which it is S_deep", 1e-3, 1.0, "D/r")
    c_d: Scalar = quantity(0.15, "", "assumed: three times what DiggingMemory does, to be on the safe side", 0.0, 1.0)
    length: Scalar = quantity(0.04, "m", "assumed: as DiggingMemory's", 0.02, 1.0, "L")
    r: Scalar = quantity(0.045, "m", "paper, section 2: of the wheels", 1e-3, 5.0, "r")

    def desired_slip(self, S_d: Scalar, D: Scalar) -> Scalar:
        """Return the desired slip of a wheel in a hole of depth D [m]; S_d is that without one."""
        share = (D / self.r - self.shallow) / (self.deep - self.shallow)
        return S_d - (S_d - self.S_deep) * ca.fmax(ca.fmin(share, 1.0), 0.0)

    def deepening(self, v: Scalar, rim: Scalar, D: Scalar) -> Scalar:
        """Return dD/dt [m/s] of a wheel that travels at v, its rim at `rim` [m/s]."""
        at = Contact(0.0, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(r=self.r), Soil())
        return DiggingMemory(c_d=self.c_d, length=self.length).rate(at, Load(), (D,))[0]
