"""Sand that has failed bears less shear: the strength that is left past the peak."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear


@dataclass(frozen=True)
class PostPeak(Effect):
    """torque <- torque (1 - L), f_t <- f_t - L torque / r, f_y <- f_y (1 - L), L = B (1 - exp(-(S / S_w)^2)).

    A dense sand's shear stress rises to a peak and falls to a residual value as the displacement grows; Eq (2) only
    rises. `fraction` B is the share of the shear that is lost when the whole patch is past the peak, taken as one
    number for the arc; what shear does not carry (resistance, normal force) stays. Acts on the load of the effects
    before it.

    Source: Wong, Theory of Ground Vehicles, shear curves with a peak and a residual stress (section 2.4.3).
    Differs from the paper: its text says that soil fails past the greatest shear, its Eq (2) has no loss. Differs from
    Wong: a function of the slip, not of the displacement at each point; f_n keeps the shear's small share in Eq (6).
    """

    title: ClassVar[str] = "loss of strength past the peak"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "sand that has failed bears less shear"
    fraction: Scalar = quantity(0.3, "", "assumed: loose to dense sand loses 0 to 0.5", 0.0, 1.0, "B")
    S_w: Scalar = quantity(0.4, "", "assumed: the slip at which 63 % of the loss has come", 0.01, 10.0, "S_w")
    neutral: ClassVar[dict[str, float]] = {"fraction": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what failure takes off the shear."""
        lost = self.lost_share(contact.S)
        pull = pull_of_shear(load.torque, contact.wheel, contact.S)
        shear = {name: -lost * getattr(load, name) for name in ("f_y", "torque", "moment_z")}
        return Load(f_t=-lost * pull, **shear)

    def lost_share(self, S: Scalar) -> Scalar:
        """Return the share L of the shear that is lost at slip S."""
        return self.fraction * (1.0 - ca.exp(-((S / self.S_w) ** 2)))
