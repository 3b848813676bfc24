"""The monitor's look ahead as CasADi expressions, and the rest in C: numbers with their reasons, struct, source."""

import ctypes
import math
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.sensing import belief
from rover_pin.control.sensing.laws import LEAST_LEVEL
from rover_pin.control.sensing.onboard_slip import CREEP
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.shared import c_table, members, struct_fields
from rover_pin.simulation.outcome.outcome import GRIP

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


RATES = np.array([0.0, 0.05, 0.1, 0.15, 0.2])
"""c_d of each hypothesis of how fast the ground digs: none, and up to four times what `DiggingMemory` assumes."""
PRIOR = np.array([0.5, 0.125, 0.125, 0.125, 0.125])
"""Their probabilities beforehand (assumed: half of all ground does not dig)."""
DRAWS = 60
"""Ways to go on that are followed at once."""
ALARM, SMOOTHED = 0.75, 0.3
"""P(stuck), smoothed over these seconds, from which an alarm is raised: that of less than five false ones an hour for
the seeds 291001 and 291002. Below half of it an alarm ends."""
WORTH, NAMED = 0.2, 0.5
"""P(stuck) from which a cause is looked for, and P of the cause from which it is named, over that."""
WINDOW = 20
"""Samples that motors and sensors are judged by."""
NUMBERS = {
    "EVERY": 2,  # samples from one look ahead to the next
    "UNSETTLED": 10,  # samples in which the belief has not felt anything yet
    "STEEPENING": 0.01,  # SD of the rate at which the ground ahead takes force [weight/s]: P is as often right as it
    # says on the drives of `studies/monitor.py` for the seed 291001
    "BALANCE_SD": 0.03,  # error of the balance of forces over the weight (assumed: strength of the soil, level)
    "STRAY": 0.05,  # likelihood, over its peak, that any balance keeps: an obstacle may push at any time
    "CORRELATED": 0.5,  # balances nearer than this err alike [s] (assumed)
    "MEMORY": 25.0,  # times longer ago than this count no more [s] (assumed)
    "RARE": 1e-3,  # probability beforehand that a motor, or a sensor of a wheel, is at fault (assumed)
    "MOTOR_SD": 0.05,  # error of the motor's law over its largest term (assumed: gears, windings)
    "MOTOR_NOISE": 0.02,  # and over the stall current (assumed: noise)
    "TURNS": 0.05,  # duty above which a motor's sensors must scatter
    "FAULT_ROWS": WINDOW,
    "DRAWS": DRAWS,
    "STEPS": STEPS,
    "ALARM": ALARM,
    "SMOOTHED": SMOOTHED,
    "WORTH": WORTH,
    "NAMED": NAMED,
    "GRIP": GRIP,
    "CREEP": CREEP,
    "LEAST_LEVEL": LEAST_LEVEL,
    "LEAST_TOUCH": TOUCH,
    "HOLE_LENGTH": float(HoleLaw().length),
    "N_RATES": len(RATES),
    "FULL_TURN": 2.0 * math.pi,
    "SQRT_TURN": math.sqrt(2.0 * math.pi),
}
FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_uint64, {"random": ""}, "unsigned long long {}"),
    (ctypes.c_int64, {"n count samples alarm": "count: readings that are kept"}, "integer {}"),
    (
        ctypes.c_double,
        {
            "period no_load_rate stall_current sinkage buried": "sinkage of a wheel that stands; over r: buried",
            "smoothed p_stuck p_buried motor sensor": "",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "radius pulls pull_slopes": "of each wheel; f_t / f_n over slips of -1 to 1, and its slopes",
            "causes past": "of `CAUSES`, the first three; duty, rate, current of the readings that are kept",
            "holes evidence by_way": "of each wheel and rate of digging; what time, and what way, tells of the rates",
            "ways draws ground": "as `AheadLaw.step` takes them; ways: where each draw begins",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"rate": "of digging, of each draw"}, "integer *{}"),
]


class MonitorStruct(ctypes.Structure):
    """The struct Monitor."""

    _fields_ = struct_fields(FIELDS)


def lengths(wheels: int) -> dict[str, int]:
    """Return the lengths of the arrays that a monitor works with."""
    lengths = {"causes": 3, "past": 3 * wheels * WINDOW, "holes": len(RATES) * wheels, "evidence": len(RATES)}
    lengths |= {"by_way": len(RATES), "rate": DRAWS}
    return lengths | {"ways": DRAWS * (3 + 2 * wheels), "draws": 4 * DRAWS, "ground": 4 * wheels + 1}


def expressions(law: AheadLaw) -> list[ca.Function]:
    """Return the laws that the monitor's C calls."""
    return [law.step(), deepening()]


def c_source() -> str:
    """Return `monitor.c` with its numbers; `real`, `integer`, structs, laws and `draws.c` stand before it."""
    lines = [f"#define {name} {value!r}" for name, value in NUMBERS.items()]
    lines += [c_table("real", "RATES", RATES), c_table("real", "PRIOR", PRIOR)]
    return "\n".join([*lines, text_of_package("rover_pin.control.monitor", "monitor.c")])


@lru_cache(maxsize=16)
def library(law: AheadLaw) -> ctypes.CDLL:
    """Return `monitor.c` with a rover's laws, compiled."""
    lines = ["#include <stdint.h>", generated_source(*expressions(law))]
    lines += ["typedef int64_t integer;", "typedef double real;", belief.constants()]
    lines += ["typedef struct {", *members(belief.FIELDS), "} Belief;"]
    lines += ["typedef struct {", *members(FIELDS), "} Monitor;"]
    lines += [text_of_package("rover_pin.control.sensing", "draws.c"), c_source()]
    handle = shared_library("\n".join(lines), "monitor")
    pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
    handle.rover_pin_monitor_reset.argtypes, handle.rover_pin_monitor_reset.restype = [pointer], None
    handle.rover_pin_monitor_check.argtypes = [pointer] * 5 + [integer]
    handle.rover_pin_monitor_foresee.argtypes, handle.rover_pin_monitor_foresee.restype = [pointer] * 2, None
    handle.rover_pin_monitor_rates.argtypes, handle.rover_pin_monitor_rates.restype = [pointer] * 2, None
    handle.rover_pin_monitor_ahead.argtypes = [pointer, integer, number, number, pointer]
    handle.rover_pin_monitor_cause.argtypes, handle.rover_pin_monitor_cause.restype = [pointer], integer
    return handle
