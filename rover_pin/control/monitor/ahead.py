"""How a rover goes on from what the on-board belief says: forces along the way, slips and holes, a step."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.sensing.laws import LEAST_LEVEL
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip

STEP, STEPS = 0.2, 20
"""Step [s], and how many make the horizon."""
HORIZON = STEP * STEPS
"""How long ahead is looked [s]."""
FASTEST = 1.1
"""Speed over that of the rims beyond which no rover is driven forwards."""


class AheadLaw(NamedTuple):
    """A rover's numbers in the law by which it goes on; in tuples, so that equal rovers share what is compiled."""

    radii: tuple[float, ...]
    relaxed: RelaxedSlip
    gravity: float

    def step(self) -> ca.Function:
        """Return the function (state), (draw), (ground), (pulls) -> state a step later.

        state: u, way, t, s of each wheel, D of each wheel. draw: c_d, resistance beyond what slope and holes explain
        [share of the weight], steepening [1/s], whether stalled. ground: rim, slope, level, load of each wheel, and the
        rims' usual speed. pulls: G = f_t / f_n at each wheel's slip, then its slopes. With w_i the share of the load:

            du/dt = g (sum w_i (G(s_i) - D_i / L - tan a_i) - excess exp(-way / r) - steepening t),  0 <= u
            s by `RelaxedSlip`, D by `HoleLaw.deepening`

        linearly implicit in u and s. A resistance that only an obstacle explains is passed within a radius.
        """
        n = len(self.radii)
        x, draw, ground = ca.SX.sym("x", 3 + 2 * n), ca.SX.sym("draw", 4), ca.SX.sym("ground", 4 * n + 1)
        pulls = ca.SX.sym("pulls", 2 * n)
        u, way, t, s, D = ca.vertsplit(x, [0, 1, 2, 3, 3 + n, 3 + 2 * n])
        c_d, excess, steepening, stalled = ca.vertsplit(draw)
        rim, slope, level, load, pace = ca.vertsplit(ground, [0, n, 2 * n, 3 * n, 4 * n, 4 * n + 1])
        G, G_s = ca.vertsplit(pulls, [0, n, 2 * n])
        level, share = ca.fmax(level, LEAST_LEVEL), load / ca.fmax(ca.sum1(load), TOUCH)
        digging = HoleLaw(c_d=c_d, r=ca.SX(ca.DM(self.radii)))
        slip_rate = self._rate(rim, u / level, s)
        implicit = STEP / (1.0 + STEP * ca.fmax(ca.fabs(rim), u / level) / self.relaxed.length)
        resisting = excess * ca.exp(-way / np.mean(self.radii)) + steepening * t
        net = ca.dot(share, G - D / digging.length - slope + G_s * implicit * slip_rate) - resisting
        stiffness = ca.dot(share, G_s * implicit / (self.relaxed.length * level))
        gain = STEP * self.gravity
        change = gain * net / (1.0 + gain * ca.fmax(stiffness, 0.0))
        u_next = (1.0 - stalled) * ca.fmin(ca.fmax(u + change, 0.0), FASTEST * pace)
        s_next = s + implicit * (slip_rate - (u_next - u) / (self.relaxed.length * level))
        D_next = ca.fmax(D + STEP * digging.deepening(u_next / level, rim, D), 0.0)
        s_next = ca.fmin(ca.fmax(s_next, -1.0), 1.0)
        following = ca.vertcat(u_next, way + STEP * u_next, t + STEP, s_next, D_next)
        return ca.Function("ahead_step", [x, draw, ground, pulls], [ca.densify(following)])

    def _rate(self, rim: ca.SX, v: ca.SX, s: ca.SX) -> ca.SX:
        at = Contact(s, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(), Soil())
        return self.relaxed.rate(at, Load(), (s, 0.0))[0]


def deepening() -> ca.Function:
    """Return the function c_d, v, rim, r, D -> dD/dt of `HoleLaw`."""
    c_d, v, rim, r, D = (ca.SX.sym(name) for name in ("c_d", "v", "rim", "r", "D"))
    return ca.Function("deepening", [c_d, v, rim, r, D], [HoleLaw(c_d=c_d, r=r).deepening(v, rim, D)])
