"""The monitor in C: its forecast as CasADi expressions, its constants with the reasons for them, its struct, and its C
source.
"""

import ctypes
import math
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.control.sensing import belief
from rover_pin.control.sensing.laws import MIN_LEVEL
from rover_pin.control.sensing.onboard_slip import MIN_PACE
from rover_pin.control.slip_control import HoleLaw
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.shared import c_table, members, struct_fields
from rover_pin.simulation.outcome.outcome import MIN_TRAVEL_RATIO

STEP, STEPS = 0.2, 20
"""Time step of the forecast (STEP) [s], and number of time steps (STEPS). The step is linearly implicit and therefore
stable at this length. The forecast covers 4 s (assumed), in which a user can still stop the rover."""
HORIZON = STEP * STEPS
"""Time that the forecast covers [s]."""
MAX_SPEED_RATIO = 1.1
"""Maximum ratio of the rover's speed to its rim speed in a forecast [-], because wheels drive a rover hardly faster
than their rims."""


class AheadLaw(NamedTuple):
    """The constants of a rover in the balance of forces. The monitor forecasts the rover's motion with this balance.

    The constants are tuples and records, so that equal rovers have equal laws and share the compiled code.
    """

    radii: tuple[float, ...]
    "radii of the wheels [m]"
    relaxed: RelaxedSlip
    """law that lets the slip of a wheel follow its speeds with a delay"""
    gravity: float
    "gravity [m/s^2]"

    def step(self) -> ca.Function:
        """Return the CasADi function (state, draw, ground, pulls) -> state, which continues a particle of the forecast
        by one time step.

        - state: speed u [m/s], distance x [m], time t [s], slip s_i and depth of the hole D_i [m] of each wheel
        - draw: rate of digging c_d, excess resistance and its rate of change (`steepening` [1/s]), both divided by the
          weight, and 1 if the wheels are stalled, else 0
        - ground: rim speed [m/s], tangent of the slope, cosine of the slope and load [N] of each wheel, then the median
          rim speed [m/s]
        - pulls: the pull factor G = f_t / f_n at the slip of each wheel, then its derivative dG/ds with respect to the
          slip

        w_i is the fraction of the load on wheel i, a_i the slope under the wheel, g the gravity, L the length of
        `HoleLaw`, and r the mean radius of the wheels. The motion follows

            du/dt = g (sum w_i (G(s_i) - D_i / L - tan a_i) - excess exp(-x / r) - steepening t),  u >= 0

        and s_i follows by `RelaxedSlip`, D_i by `HoleLaw.deepening`. The excess resistance is the part of the
        resistance that slope and holes do not explain: an obstacle that the rover passes within about one wheel radius.
        The step is linearly implicit in u and s, because the relaxation of the slip is stiff at low speed.
        """
        # Symbols of the four inputs, and the names of their parts.
        n = len(self.radii)
        x, draw, ground = ca.SX.sym("x", 3 + 2 * n), ca.SX.sym("draw", 4), ca.SX.sym("ground", 4 * n + 1)
        pulls = ca.SX.sym("pulls", 2 * n)
        u, distance, t, s, D = ca.vertsplit(x, [0, 1, 2, 3, 3 + n, 3 + 2 * n])
        c_d, excess, steepening, stalled = ca.vertsplit(draw)
        rim, slope, level, load, pace = ca.vertsplit(ground, [0, n, 2 * n, 3 * n, 4 * n, 4 * n + 1])
        G, G_s = ca.vertsplit(pulls, [0, n, 2 * n])
        level, share = ca.fmax(level, MIN_LEVEL), load / ca.fmax(ca.sum1(load), TOUCH)
        digging = HoleLaw(c_d=c_d, r=ca.SX(ca.DM(self.radii)))
        contact = Contact(s, 0.0, TOUCH, u / level, 0.0, 0.0, rim, 0.0, 0, Wheel(), Soil())
        slip_rate = self.relaxed.rate(contact, Load(), (s, 0.0))[0]
        # `implicit` is the step divided by (1 + step / time constant of the slip): the linearly implicit step of a
        # relaxation.
        implicit = STEP / (1.0 + STEP * ca.fmax(ca.fabs(rim), u / level) / self.relaxed.length)
        resisting = excess * ca.exp(-distance / np.mean(self.radii)) + steepening * t
        # `net` is the net force at the new slips, divided by the weight, and `stiffness` its decrease with the new
        # speed. The linear equation for the change of the speed is then solved.
        net = ca.dot(share, G - D / digging.length - slope + G_s * implicit * slip_rate) - resisting
        stiffness = ca.dot(share, G_s * implicit / (self.relaxed.length * level))
        gain = STEP * self.gravity
        change = gain * net / (1.0 + gain * ca.fmax(stiffness, 0.0))
        # The speed stays between 0 and the fastest rolling; a stalled rover stands.
        u_next = (1.0 - stalled) * ca.fmin(ca.fmax(u + change, 0.0), MAX_SPEED_RATIO * pace)
        s_next = s + implicit * (slip_rate - (u_next - u) / (self.relaxed.length * level))
        D_next = ca.fmax(D + STEP * digging.deepening(u_next / level, rim, D), 0.0)
        s_next = ca.fmin(ca.fmax(s_next, -1.0), 1.0)
        following = ca.vertcat(u_next, distance + STEP * u_next, t + STEP, s_next, D_next)
        return ca.Function("ahead_step", [x, draw, ground, pulls], [ca.densify(following)])


def deepening() -> ca.Function:
    """Return the CasADi function (c_d, v, rim, r, D) -> dD/dt, the rate at which a wheel's hole becomes deeper by
    `HoleLaw`.

    c_d is the rate of digging [-], v the travel speed of the wheel and `rim` its rim speed [m/s], r its radius [m] and
    D the depth of its hole [m].
    """
    c_d, v, rim, r, D = (ca.SX.sym(name) for name in ("c_d", "v", "rim", "r", "D"))
    return ca.Function("deepening", [c_d, v, rim, r, D], [HoleLaw(c_d=c_d, r=r).deepening(v, rim, D)])


RATES = np.array([0.0, 0.05, 0.1, 0.15, 0.2])
"""Hypotheses of the monitor about the rate of digging, the coefficient c_d of `DiggingMemory` [-]: the wheels do not
dig, or they dig at one to four times the default rate of `DiggingMemory`, which is 0.05."""
PRIOR = np.array([0.5, 0.125, 0.125, 0.125, 0.125])
"""Prior probabilities of the rates of digging in `RATES` (assumed: half of all soils do not dig)."""
DRAWS = 60
"""Number of particles that a forecast continues. A probability that is the fraction of 60 particles has a standard
deviation of at most 0.065; more particles would cost computing time on the rover's computer."""
ALARM, SMOOTHING_TIME = 0.75, 0.3
"""Maximum smoothed P(stuck) without an alarm, and the time constant of the smoothing [s]. The alarm ends when the
smoothed P(stuck) falls below half of ALARM. With these numbers, there were fewer than five false alarms per hour for
the seeds 291001 and 291002 of `studies/monitor.py`."""
WORTH, NAMED = 0.2, 0.5
"""The monitor searches for a cause only if P(stuck) is at least WORTH. It names a cause only if the cause's probability
is at least the fraction NAMED of P(stuck); otherwise it states that it cannot tell (both assumed)."""
WINDOW = 20
"""Number of latest samples in the search for faults of motors and sensors."""
NUMBERS = {
    "EVERY": 2,  # samples from one forecast to the next
    "UNSETTLED": 10,  # first samples, in which the belief has no rates of the posture yet
    "STEEPENING": 0.01,  # SD of the rate at which the ground ahead becomes steeper [1/s]; it calibrates P(stuck) on the
    # drives of `studies/monitor.py` for the seed 291001
    "BALANCE_SD": 0.03,  # error of the balance of forces, divided by the weight (assumed: strength of the soil, level)
    "STRAY": 0.05,  # smallest likelihood of a balance, divided by its peak, as an obstacle may push at any time
    "CORRELATED": 0.5,  # balances of forces within this time have one error [s] (assumed)
    "MEMORY": 25.0,  # time constant after which old evidence fades [s] (assumed)
    "RARE": 1e-3,  # prior probability that a motor, or a sensor of a wheel, is faulty (assumed)
    "MOTOR_SD": 0.05,  # error of the motor's law, divided by its largest term (assumed: gears, windings)
    "MOTOR_NOISE": 0.02,  # error of the motor's law, divided by the stall current (assumed: noise)
    "TURNS": 0.05,  # duty above which the readings of a motor must change from sample to sample
    "FAULT_ROWS": WINDOW,
    "DRAWS": DRAWS,
    "STEPS": STEPS,
    "ALARM": ALARM,
    "SMOOTHING_TIME": SMOOTHING_TIME,
    "WORTH": WORTH,
    "NAMED": NAMED,
    "GRIP": MIN_TRAVEL_RATIO,  # ratio of the speed to the rim speed below which the rover is stuck
    "MIN_PACE": MIN_PACE,  # rim speed below which there is no forecast [m/s]
    "MIN_LEVEL": MIN_LEVEL,
    "MIN_TOUCH": TOUCH,  # smallest rim speed in the comparison with GRIP [m/s]
    "HOLE_LENGTH": float(HoleLaw().length),
    "N_RATES": len(RATES),
    "FULL_TURN": 2.0 * math.pi,
    "SQRT_TURN": math.sqrt(2.0 * math.pi),
}
"""Values of the constants of `monitor.c`, by their names."""
FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_uint64, {"random": "state of the random numbers"}, "unsigned long long {}"),
    (
        ctypes.c_int64,
        {
            "n": "wheels",
            "count": "readings that are kept, at most FAULT_ROWS",
            "samples": "samples since the start",
            "alarm": "1 while the alarm is on",
        },
        "integer {}",
    ),
    (
        ctypes.c_double,
        {
            "period": "time between two samples [s]",
            "no_load_rate": "rate of a wheel at full duty without load [rad/s]",
            "stall_current": "current of a motor at full duty that does not turn [A]",
            "sinkage": "sinkage of a wheel on fresh ground without slip [m]",
            "buried": "ratio of sinkage to radius above which a wheel is buried",
            "smoothed": "smoothed P(stuck)",
            "p_stuck": "P(stuck)",
            "p_buried": "P(buried)",
            "motor": "probability that a motor is faulty",
            "sensor": "1: a sensor is faulty",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "radius": "(n) wheel radii [m]",
            "pulls": "(N_FACTORS) f_t / f_n over slips from -1 to 1",
            "pull_slopes": "(N_FACTORS) derivatives of the pulls by the slip",
            "causes": "(3) probabilities of lost grip, digging and a wall",
            "past": "(FAULT_ROWS, 3, n) duty, rate and current of the latest readings, over their maxima",
            "holes": "(n, N_RATES) depth of the hole of each wheel, for each rate of digging [m]",
            "evidence": "(N_RATES) log likelihood of each rate of digging, by the evidence of the whole time",
            "by_way": "(N_RATES) log likelihood of each rate of digging, by the evidence of the driven distance",
            "ways": "(DRAWS, 3 + 2 n) initial state of each particle in the forecast",
            "draws": "(DRAWS, 4) draw of each particle, for `AheadLaw.step`",
            "ground": "(4 n + 1) ground under the wheels, for `AheadLaw.step`",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"rate": "(DRAWS) index of the rate of digging of each particle"}, "integer *{}"),
]
"""Fields of the C struct Monitor, in groups of one type: the ctypes type, the names with their meaning, and the C
declaration."""


class MonitorStruct(ctypes.Structure):
    """The C struct Monitor, the memory of the monitor, as a ctypes structure of equal layout. Python fills it and C
    code updates it.
    """

    _fields_ = struct_fields(FIELDS)


def lengths(wheels: int) -> dict[str, int]:
    """Return the length of each array in the C struct Monitor for a number of wheels, by the name of the array.

    The constant tables `radius`, `pulls` and `pull_slopes` are not included.
    """
    lengths = {"causes": 3, "past": 3 * wheels * WINDOW, "holes": len(RATES) * wheels, "evidence": len(RATES)}
    lengths |= {"by_way": len(RATES), "rate": DRAWS}
    return lengths | {"ways": DRAWS * (3 + 2 * wheels), "draws": 4 * DRAWS, "ground": 4 * wheels + 1}


def expressions(law: AheadLaw) -> list[ca.Function]:
    """Return the CasADi functions that `monitor.c` calls: the time step of the forecast, and the law of the deepening
    of holes.
    """
    return [law.step(), deepening()]


def c_source() -> str:
    """Return the C code of the monitor: the definitions of its constants, and the text of `monitor.c`.

    The types `real` and `integer`, the structs, the functions of `expressions` and the text of `draws.c` must come
    before this code.
    """
    # The constants become macros and tables, so that Python and C have a single definition of each.
    lines = [f"#define {name} {value!r}" for name, value in NUMBERS.items()]
    lines += [c_table("real", "RATES", RATES), c_table("real", "PRIOR", PRIOR)]
    return "\n".join([*lines, text_of_package("rover_pin.onboard.monitor", "monitor.c")])


@lru_cache(maxsize=16)
def library(law: AheadLaw) -> ctypes.CDLL:
    """Return the shared library compiled from `monitor.c` for one rover. Rovers with equal laws share one library."""
    # The monitor reads the struct of the slip estimate, so that its declaration comes before the monitor's struct.
    lines = ["#include <stdint.h>", generated_source(*expressions(law))]
    lines += ["typedef int64_t integer;", "typedef double real;", belief.constants()]
    lines += ["typedef struct {", *members(belief.FIELDS), "} Belief;"]
    lines += ["typedef struct {", *members(FIELDS), "} Monitor;"]
    lines += [text_of_package("rover_pin.control.sensing", "draws.c"), c_source()]
    # The types of the arguments protect from wrong calls, since ctypes would pass any number as an int.
    handle = shared_library("\n".join(lines), "monitor")
    pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
    handle.rover_pin_monitor_reset.argtypes, handle.rover_pin_monitor_reset.restype = [pointer], None
    handle.rover_pin_monitor_check.argtypes = [pointer] * 5 + [integer]
    handle.rover_pin_monitor_foresee.argtypes, handle.rover_pin_monitor_foresee.restype = [pointer] * 2, None
    handle.rover_pin_monitor_rates.argtypes, handle.rover_pin_monitor_rates.restype = [pointer] * 2, None
    handle.rover_pin_monitor_ahead.argtypes = [pointer, integer, number, number, pointer]
    handle.rover_pin_monitor_cause.argtypes, handle.rover_pin_monitor_cause.restype = [pointer], integer
    return handle
