"""How a rover goes on from what the on-board belief says: forces along the way, slips and holes, step by step."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.sensing.laws import LEAST_LEVEL
from rover_pin.control.sensing.onboard_slip import SLIPS
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library

DRAWS = 60
"""Ways to go on that are followed at once."""
STEP, STEPS = 0.2, 20
"""Step [s], and how many make the horizon."""
HORIZON = STEP * STEPS
"""How long ahead is looked [s]."""
FASTEST = 1.1
"""Speed over that of the rims beyond which no rover is driven forwards."""


class Ways(NamedTuple):
    """What becomes of each draw (DRAWS,)."""

    share: np.ndarray
    "speed over the horizon's end, over that of the rims [-]"
    depth: np.ndarray
    "greatest depth of a wheel's hole within the horizon, over r [-]"


class AheadLaw(NamedTuple):
    """A rover's numbers in the law by which it goes on; in tuples, so that equal rovers share what is compiled."""

    radii: tuple[float, ...]
    relaxed: RelaxedSlip
    gravity: float

    def step(self) -> ca.Function:
        """Return the function (state), (draw), (ground), (pulls) -> state a step later.

        state: u, way, t, s of each wheel, D of each wheel. draw: c_d, resistance beyond what slope and holes explain
        [share of the weight], steepening [1/s], whether stalled. ground: rim, slope, level, load of each wheel, and the
        rims' usual speed. pulls: G = f_t / f_n over `SLIPS`, and its slope. With w_i the share of the load:

            du/dt = g (sum w_i (G(s_i) - D_i / L - tan a_i) - excess exp(-way / r) - steepening t),  0 <= u
            s by `RelaxedSlip`, D by `HoleLaw.deepening`

        linearly implicit in u and s. A resistance that only an obstacle explains is passed within a radius.
        """
        n = len(self.radii)
        x, draw, ground = ca.MX.sym("x", 3 + 2 * n), ca.MX.sym("draw", 4), ca.MX.sym("ground", 4 * n + 1)
        pulls = ca.MX.sym("pulls", 2 * len(SLIPS))
        u, way, t, s, D = ca.vertsplit(x, [0, 1, 2, 3, 3 + n, 3 + 2 * n])
        c_d, excess, steepening, stalled = ca.vertsplit(draw)
        rim, slope, level, load, pace = ca.vertsplit(ground, [0, n, 2 * n, 3 * n, 4 * n, 4 * n + 1])
        level, share = ca.fmax(level, LEAST_LEVEL), load / ca.fmax(ca.sum1(load), TOUCH)
        digging = HoleLaw(c_d=c_d, r=ca.MX(ca.DM(self.radii)))
        slip_rate = self._rate(rim, u / level, s)
        table = ca.interpolant("pull", "linear", [SLIPS.tolist()], 2, {"lookup_mode": ["exact"]})
        G, G_s = ca.horzsplit(ca.horzcat(*(table(s[i], pulls) for i in range(n))).T)
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
        return ca.Function("ahead_step", [x, draw, ground, pulls], [following])

    def _rate(self, rim: ca.MX, v: ca.MX, s: ca.MX) -> ca.MX:
        at = Contact(s, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(), Soil())
        return self.relaxed.rate(at, Load(), (s, 0.0))[0]


class Pull(NamedTuple):
    """How a wheel pulls: f_t / f_n over `SLIPS`."""

    factors: np.ndarray

    @property
    def table(self) -> np.ndarray:
        """Factors and their slopes, as `AheadLaw.step` takes them."""
        return np.stack([self.factors, np.gradient(self.factors, SLIPS)], axis=1).ravel()

    def less_resistance(
        self, slips: np.ndarray, holes: np.ndarray, shares: np.ndarray, slopes: np.ndarray
    ) -> np.ndarray:
        """Return pull less what slope and holes take, over the weight [-]: (wheels, any) -> (any,)."""
        pulls = np.interp(slips, SLIPS, self.factors)
        return np.asarray(shares @ (pulls - holes / float(HoleLaw().length) - slopes[:, None]))


def go_on(law: AheadLaw, table: np.ndarray, state: np.ndarray, draws: np.ndarray, ground: np.ndarray) -> Ways:
    """Return where draws (a column each) come to; `table` is of `Pull`."""
    ends, n = np.asarray(_horizon(law)(state, draws, ground, table)), len(law.radii)
    return Ways(ends[0] / max(ground[-1], TOUCH), np.max(ends[3 + n :] / np.array(law.radii)[:, None], axis=0))


@lru_cache(maxsize=16)
def _horizon(law: AheadLaw) -> ca.Function:
    """Return the compiled function of all draws over all steps; holes are deepest at the end where a rover is stuck."""
    step = law.step()
    inputs = [ca.MX.sym(step.name_in(i), step.size1_in(i)) for i in range(4)]
    x, *fixed = inputs
    end = step.fold(STEPS)(x, *(ca.repmat(column, 1, STEPS) for column in fixed))
    every = ca.Function("ahead", inputs, [end]).map("ahead_all", "serial", DRAWS, [2, 3], [])
    library = shared_library(generated_source(every), "ahead")
    return ca.external(every.name(), library._name)
