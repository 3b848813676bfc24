"""Springs and dampers in the suspension."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push, joints_called


@dataclass(frozen=True)
class SpringDamper(BodyEffect):
    """torque = -k_s (q - q_0) - d q' on joints of the suspension; it holds sum k_s (q - q_0)^2 / 2 [J].

    On every joint, or on those that `joint` names: one ("bogie_l") or a pair ("bogie"). A model may have one of each
    name; where they overlap, their torques add. Equal springs on both rockers of a rigid differential push against the
    body's roll relative to them, not against its pitch, and their q_0 then cancels.
    Source: Kelvin-Voigt element; the paper, section 1: links are connected "by a free joint or a differential joint, or
    a spring-damper mechanism, if necessary". Differs from the paper: it gives no sizes; its test bed has no springs.
    """

    title: ClassVar[str] = "springs in the suspension"
    meaning: ClassVar[str] = "joints of the suspension are sprung and damped"
    k_s: Scalar = quantity(1.0, "N m/rad", "assumed: a wheel's 9.5 N on 75 mm bend it by 0.7 rad", 0.0, 1e4, "k_s")
    d: Scalar = quantity(0.05, "N m s/rad", "assumed: with k_s, dies out within 0.05 s", 0.0, 1e3, "d")
    q_0: Scalar = quantity(0.0, "rad", "assumed: relaxed where the wheels stand on a plane", -3.2, 3.2, "q_0")
    joint: str = ""
    "channel of the joint (bogie_l), start of a pair's (bogie), or nothing for all joints of the suspension"
    in_pivots: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"k_s": 0.0, "d": 0.0}

    def push(self, body: Body) -> Push:
        """Return the torques; none on joints that are not meant."""
        states = zip(self._shares(body), body.angles, body.rates, strict=True)
        return Push(joints=tuple(-share * (self.k_s * (q - self.q_0) + self.d * rate) for share, q, rate in states))

    def stored_energy(self, body: Body) -> Scalar:
        """Return the energy in the springs."""
        pairs = zip(self._shares(body), body.angles, strict=True)
        return 0.5 * self.k_s * sum((share * (q - self.q_0) ** 2 for share, q in pairs), 0.0)

    def _shares(self, body: Body) -> list[float]:
        """Return 1 for each joint that is meant and 0 for the others."""
        if not self.joint:
            return [1.0] * len(body.angles)
        return [float(name in joints_called(self.joint, body.names)) for name in body.names]
