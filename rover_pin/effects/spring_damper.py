"""Springs and dampers in the suspension."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push, joints_called


@dataclass(frozen=True)
class SpringDamper(BodyEffect):
    """Joints of the suspension have springs and dampers: torque = -k_s (q - q_0) - d q'.

    q is the angle of the joint, q' its rate, and the stored energy is sum k_s (q - q_0)^2 / 2 [J]. The springs act on
    every joint, or on the joints that `joint` names: one ("bogie_l") or a pair ("bogie"). A model may have one such
    effect for each name; if they overlap, their torques add. Equal springs on both rockers of a rigid differential act
    against the body's roll relative to them, not against its pitch, and their q_0 cancel.

    Source: Kelvin-Voigt element; the paper, section 1: links are connected "by a free joint or a differential joint, or
    a spring-damper mechanism, if necessary". Differs from the paper: it gives no sizes; its test bed has no springs.
    """

    title: ClassVar[str] = "springs in the suspension"
    meaning: ClassVar[str] = "joints of the suspension are sprung and damped"
    k_s: Scalar = quantity(
        1.0, "N m/rad", "assumed: a wheel load of 9.5 N at 75 mm turns the joint by 0.7 rad", 0.0, 1e4, "k_s"
    )
    d: Scalar = quantity(0.05, "N m s/rad", "assumed: with k_s, dies out within 0.05 s", 0.0, 1e3, "d")
    q_0: Scalar = quantity(0.0, "rad", "assumed: relaxed with all wheels on a plane", -3.2, 3.2, "q_0")
    joint: str = ""
    """channel name of one joint (bogie_l), the common start of a pair (bogie), or empty for all joints of the
    suspension"""
    in_pivots: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"k_s": 0.0, "d": 0.0}

    def push(self, body: Body) -> Push:
        """Return the torque of spring and damper on each suspension joint; it is zero for joints that `joint` does not
        select.
        """
        states = zip(self._shares(body), body.angles, body.rates, strict=True)
        return Push(joints=tuple(-share * (self.k_s * (q - self.q_0) + self.d * rate) for share, q, rate in states))

    def stored_energy(self, body: Body) -> Scalar:
        """Return the elastic energy in all springs of the suspension [J]."""
        pairs = zip(self._shares(body), body.angles, strict=True)
        return 0.5 * self.k_s * sum((share * (q - self.q_0) ** 2 for share, q in pairs), 0.0)

    def _shares(self, body: Body) -> list[float]:
        """Return, for each joint of the suspension, 1 if it has a spring of this effect, and 0 if not."""
        if not self.joint:
            return [1.0] * len(body.angles)
        return [float(name in joints_called(self.joint, body.names)) for name in body.names]
