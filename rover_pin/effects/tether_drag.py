"""A cable that the rover drags behind it."""

from dataclasses import dataclass
from typing import ClassVar, Self

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push


@dataclass(frozen=True)
class TetherDrag(BodyEffect):
    """A cable that the rover drags behind it pulls the base back, the more the further the rover is from the start of
    the cable.

        F = -(f_0 + f_1 s) v / sqrt(|v|^2 + v_0^2)

    F acts on the base's origin, v is its horizontal velocity, and s its distance from (x_0, y_0), which are counted
    from the start of the drive, so that every run pulls out its own tether. f_0 is the pull of the guide, f_1 the
    friction of each metre of cable on the ground.

    Source: assumed form, dry friction of a rope. Differs from the paper: its rover drags nothing. Differs from a cable:
    the force opposes the velocity instead of pulling along the rope, it acts at the base's origin, and a rope that
    slackens on the return is not modelled.
    """

    title: ClassVar[str] = "tether drag"
    meaning: ClassVar[str] = "a cable or tether pulls the rover back"
    f_0: Scalar = quantity(0.5, "N", "assumed: 1 % of the rover's weight", 0.0, 1e3, "f_0")
    f_1: Scalar = quantity(0.2, "N/m", "assumed: a cable of 40 g/m, friction 0.5", 0.0, 1e3, "f_1")
    x_0: Scalar = quantity(0.0, "m", "beginning of the tether, relative to the start of the drive", -1e4, 1e4, "x_0")
    y_0: Scalar = quantity(0.0, "m", "beginning of the tether, relative to the start of the drive", -1e4, 1e4, "y_0")
    v_0: Scalar = quantity(0.002, "m/s", "assumed: a twentieth of the paper's 0.05 m/s", 1e-5, 1.0, "v_0")
    only_resists: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"f_0": 0.0, "f_1": 0.0}
    places: ClassVar[tuple[str, ...]] = ("x_0", "y_0")

    def begin_at(self, x: float, y: float) -> Self:
        """Return the effect with the start of the tether in the world, for a drive that starts with the base at the
        position (x, y) [m].

        The parameters x_0 and y_0 are relative to the start of the drive; the returned effect has them relative to the
        origin of the world.
        """
        return self.replace(x_0=self.x_0 + x, y_0=self.y_0 + y)

    def push(self, body: Body) -> Push:
        """Return the pull [N] of the cable on the base, against the base's horizontal velocity."""
        x, y = body.x - self.x_0, body.y - self.y_0
        # A small number keeps the root differentiable at the start of the tether.
        distance = ca.sqrt(x * x + y * y + 1e-12)
        # The drag fades below the speed v_0, so that it does not push a rover that stands.
        speed = ca.sqrt(body.v_x * body.v_x + body.v_y * body.v_y + self.v_0 * self.v_0)
        drag = (self.f_0 + self.f_1 * distance) / speed
        return Push(f_x=-drag * body.v_x, f_y=-drag * body.v_y)
