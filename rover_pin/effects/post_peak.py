"""Sand that has failed and bears less shear: the residual strength past the peak."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear


@dataclass(frozen=True)
class PostPeak(Effect):
    """Sand that has failed bears less shear: the fraction L of the shear is lost as the slip grows.

        L = B (1 - exp(-(S / S_w)^2)),
        torque <- (1 - L) torque,   f_y <- (1 - L) f_y,   f_t <- f_t - L torque / r.

    The shear stress of dense sand rises to a peak and then falls to a residual value as the displacement grows, while
    Eq (2) only rises. B (`fraction`) is the fraction of the shear that is lost when the whole contact is past the peak,
    one number for the whole arc. Forces that shear does not carry (resistance, normal force) stay. The effect acts on
    the load of the effects before it.

    Source: Wong, Theory of Ground Vehicles, shear curves with a peak and a residual stress (section 2.4.3). Differs
    from the paper: its text states that soil fails past the maximum shear, but its Eq (2) has no loss. Differs from
    Wong: the loss depends on the slip, not on the displacement at each point, and f_n keeps the small part that shear
    contributes to Eq (6).
    """

    title: ClassVar[str] = "loss of strength past the peak"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "sand that has failed bears less shear"
    fraction: Scalar = quantity(0.3, "", "assumed: loose to dense sand loses 0 to 0.5", 0.0, 1.0, "B")
    S_w: Scalar = quantity(0.4, "", "assumed: the slip at which 63 % of the loss has come", 0.01, 10.0, "S_w")
    neutral: ClassVar[dict[str, float]] = {"fraction": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the change of the load: the forces and the torque that the soil no longer bears after it
        has failed.
        """
        # The pull that shear gives follows from the torque, because shear acts at the radius of the rim.
        lost = self.lost_share(contact.S)
        pull = pull_of_shear(load.torque, contact.wheel, contact.S)
        # Only forces that shear carries are reduced.
        shear = {name: -lost * getattr(load, name) for name in ("f_y", "torque", "moment_z")}
        return Load(f_t=-lost * pull, **shear)

    def lost_share(self, S: Scalar) -> Scalar:
        """Return the fraction [-] of the shear that the soil has lost at the slip S."""
        return self.fraction * (1.0 - ca.exp(-((S / self.S_w) ** 2)))
