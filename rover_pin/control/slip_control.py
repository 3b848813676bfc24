"""The slip control of section 5 of the paper (Fig 9): a PI law for the duty of each wheel, within a torque limit.

The file also contains the hole law, which lowers the desired slip of a wheel in a deep hole, and functions that read
and write files of gains.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.encode import printable
from rover_pin.base.files.toml_file import read_toml, table_in, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.public import brief, public
from rover_pin.base.quantity import Record, quantities, quantity, record_from
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.control.slip_estimate import SlipEstimate, TableEstimate, TrueSlip
from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.effects.digging_memory import TOUCH, DiggingMemory
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import CompiledController, SlipLaw
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD
from rover_pin.soil.slip import speed_ratio

INTEGRAL_FADE = 0.005
"""Excess of the requested duty above its limit [-] at which the integral of the PI law stops completely. Below this
excess, the integral slows down gradually, because a sudden stop would make the duty chatter at the limit."""

MIN_BRAKING_RATIO = 0.05
"""Minimum ratio of rim speed to travel speed of a braking wheel [-] for the computation of its travel speed. A smaller
ratio is replaced by this value, because the travel speed of a locked wheel would be the rim speed 0 divided by 0."""


@dataclass(frozen=True)
class Gains(Record):
    """Gains and limits of the PI law for a wheel's duty, delta = delta_0 + k_p e + k_i int e dt, with the error e = S_d
    - S_hat.

    S_d is the desired slip of the wheel, and S_hat its estimated slip.
    """

    S_d: Scalar = quantity(0.1, "", "paper, section 5", -1.0, 1.0, "S_d")
    k_p: Scalar = quantity(0.1, "", "assumed: not in the paper", 0.0, 100.0, "k_p")
    k_i: Scalar = quantity(1.0, "1/s", "assumed: not in the paper", 0.0, 1000.0, "k_i")
    delta_0: Scalar = quantity(0.55, "", "paper, section 5: cruise duty", -1.0, 1.0, "delta_0")
    delta_min: Scalar = quantity(0.05, "", "assumed: a wheel is never stopped", -1.0, 1.0, "delta_min")
    delta_max: Scalar = quantity(0.55, "", "assumed: the duty without control", -1.0, 1.0, "delta_max")


HOLE_GAINS = Gains(S_d=0.6, k_p=1.65, k_i=10.0)
"""Gains for a control with a `HoleLaw`. They were tuned together with the numbers of the hole law, on drives that no
study uses."""


@dataclass(frozen=True)
class HoleLaw(Record):
    """A law that lowers the desired slip S_d of a wheel as the hole that the wheel has dug becomes deeper.

    In a hole of depth D, S_d(D) = S_d - (S_d - S_deep) min(max((D / r - shallow) / (deep - shallow), 0), 1), for each
    wheel separately. S_d is the desired slip without a hole, S_deep the desired slip in a deep hole, and r the radius
    of the wheel.

    On firm ground, the thrust alone decides the slip of a wheel. In a deep hole it may slip less, so that it digs no
    deeper. The depth D [m] is an estimate, either from `DiggingMemory` with the wheel's slip and rim speed, or from a
    `SlipEstimate` that has an attribute `hole`. The depths at which S_d decreases are in units of r, because a wheel
    counts as buried at r / 2.

    Source: none; the numbers come from a search on drives of Nexus 6, where r = 45 mm and the depths are 4.5 and 9 mm.
    Differs from the paper: the desired slip of the paper is constant.
    """

    S_deep: Scalar = quantity(0.1, "", "paper, section 5: its S_d, here for a deep hole", -1.0, 1.0, "S_d")
    shallow: Scalar = quantity(0.1, "", "tuned: the D / r above which S_d decreases", 0.0, 1.0, "D/r")
    deep: Scalar = quantity(0.2, "", "tuned: the D / r above which S_d is S_deep", 1e-3, 1.0, "D/r")
    c_d: Scalar = quantity(
        0.15, "", "assumed: three times the value of DiggingMemory, to be on the safe side", 0.0, 1.0
    )
    length: Scalar = quantity(0.04, "m", "assumed: the length L of DiggingMemory", 0.02, 1.0, "L")
    r: Scalar = quantity(0.045, "m", "paper, section 2: radius of the wheels", 1e-3, 5.0, "r")

    def desired_slip(self, S_d: Scalar, D: Scalar) -> Scalar:
        """Return the desired slip [-] of a wheel in a hole of depth D [m]. S_d is the desired slip without a hole."""
        share = (D / self.r - self.shallow) / (self.deep - self.shallow)
        return S_d - (S_d - self.S_deep) * ca.fmax(ca.fmin(share, 1.0), 0.0)

    def deepening(self, v: Scalar, rim: Scalar, D: Scalar) -> Scalar:
        """Return dD/dt [m/s], the rate at which the hole of a wheel becomes deeper, by the law of `DiggingMemory`.

        v is the travel speed of the wheel and `rim` its rim speed [m/s]; D is the present depth of the hole [m].
        """
        contact = Contact(0.0, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(r=self.r), Soil())
        return DiggingMemory(c_d=self.c_d, length=self.length).rate(contact, Load(), (D,))[0]


class PiStep(NamedTuple):
    """The result of the PI law for one wheel at one sample: the duty, and the rate of the integral."""

    duty: Scalar
    "duty within its limits [-]"
    rate: Scalar
    "rate of change dI/dt of the integral part I of the duty [1/s]"


def pi_law(gains: Gains, S_hat: Scalar, integral: Scalar, highest: Scalar) -> PiStep:
    """Return the duty of a wheel by the PI law, and the rate of its integral I, for floats or CasADi expressions.

        e = S_d - S_hat,  asked = delta_0 + k_p e + I,  duty = asked, clipped to [delta_min, min(delta_max, highest)]
        dI/dt = k_i e (1 - min(x / INTEGRAL_FADE, 1)),  x = max(0, (asked - duty) sign(e))

    While the duty is at a limit and the error e would push it further beyond the limit, the integral stops (conditional
    integration). The integral continues as soon as e changes its sign or the limit recedes. Without this rule, the
    integral would wind up on level ground, where the slip depends on the load and not on the duty.

    Parameters
    ----------
    gains : Gains
        Desired slip S_d, gains k_p and k_i, cruise duty delta_0, and the limits of the duty.
    S_hat : Scalar
        Estimated slip of the wheel [-].
    integral : Scalar
        Integral I, a part of the duty [-].
    highest : Scalar
        Highest duty that the torque limit allows [-]. If `highest` is below delta_min, it replaces delta_min.

    Source: section 5, Fig 9. Differs from the paper: the paper does not state how its integral behaves at the limit.
    """
    # delta_min gives way to the torque limit, which may be below it: the bound of the soil has priority.
    error = gains.S_d - S_hat
    unclamped = gains.delta_0 + gains.k_p * error + integral
    upper = ca.fmin(gains.delta_max, highest)
    lower = ca.fmin(gains.delta_min, upper)
    duty = ca.fmin(ca.fmax(unclamped, lower), upper)
    # The part of the request beyond the limit, counted only where e pushes further out.
    outward = ca.fmax((unclamped - duty) * ca.sign(error), 0.0)
    return PiStep(duty, gains.k_i * error * (1.0 - ca.fmin(outward / INTEGRAL_FADE, 1.0)))


@lru_cache(maxsize=16)
def _wheel_law(hole: HoleLaw | None) -> ca.Function:
    """Return the CasADi function of the PI law of one wheel. If a hole law is given, the function includes it.

    The inputs are a vector (S_hat, I, highest duty, wheel rate [rad/s], travel speed v [m/s], hole depth D [m]) and the
    gains. S_hat is the estimated slip and I the integral part of the duty. The output is (duty, dI/dt, dD/dt).
    """
    # With a hole law, the desired slip of the gains decreases with the depth of the hole.
    p, x = ca.SX.sym("gains", len(quantities(Gains))), ca.SX.sym("x", 6)
    gains = Gains(**dict(zip(quantities(Gains), ca.vertsplit(p), strict=True)))
    S_hat, integral, highest, rate, v, D = ca.vertsplit(x)
    deepening = ca.SX(0.0)
    if hole:
        deepening = hole.deepening(v, hole.r * rate, D)
        gains = gains.replace(S_d=hole.desired_slip(gains.S_d, D))
    return ca.Function("pi_law", [x, p], [ca.vertcat(*pi_law(gains, S_hat, integral, highest), deepening)])


@lru_cache(maxsize=16)
def _all_wheels_law(wheels: int, hole: HoleLaw | None) -> ca.Function:
    """Return the CasADi function of the PI laws of all wheels: the function of `_wheel_law`, evaluated for one column
    of inputs for each wheel.
    """
    return _wheel_law(hole).map("slip_control", "serial", wheels, [1], [])


@brief
@public
@dataclass
class SlipControl:
    """The slip control of all wheels: a PI law for each wheel, sampled every `period`; duties are constant between
    samples.

    The duty of each wheel is delta = delta_0 + k_p (S_d - S_hat) + k_i int (S_d - S_hat) dt, where S_d is the desired
    and S_hat the estimated slip. The duty is kept within the limits of the gains and of the torque limit. The control
    keeps one integral for each wheel, and `reset` sets all integrals to 0.

    Parameters
    ----------
    gains : Gains
        Desired slip S_d, gains k_p and k_i, cruise duty delta_0, and the limits of the duty.
    estimate : SlipEstimate
        Source of S_hat: `TrueSlip`, the `TableEstimate` of Eq (9), or your own object with a method `slip(reading)`.
    limit : TorqueLimit or NoLimit
        Highest duty of each wheel by the torque check.
    period : float
        Time between two samples [s].
    hole : HoleLaw, optional
        Makes S_d decrease as the hole of a wheel deepens; without a hole law, S_d is constant.
    integral, depth : array (wheels,) or float
        Integral part of the duty [-] and estimated depth of the hole [m] of each wheel.

    Source: section 5, Fig 9. Differs from the paper: see `pi_law`. The paper has no hole law.

    Examples
    --------
    >>> from rover_pin.control.slip_control import Gains
    >>> from rover_pin.control.slip_estimate import TrueSlip
    >>> from rover_pin import scenario, simulate
    >>> control = SlipControl(Gains(S_d=0.2), TrueSlip())
    >>> held = simulate(scenario("flat").model, control, 2.0)
    >>> float(held["duty_fl"].max()) <= 1.0
    True
    """

    gains: Gains
    estimate: SlipEstimate
    limit: TorqueLimit | NoLimit = field(default_factory=NoLimit)
    period: float = CONTROL_PERIOD
    hole: HoleLaw | None = None
    integral: np.ndarray | float = 0.0
    depth: np.ndarray | float = 0.0

    def reset(self) -> None:
        """Set the integrals and the depths of the holes to 0, and reset the slip estimate if it has a memory."""
        self.integral, self.depth = 0.0, 0.0
        if hasattr(self.estimate, "reset"):
            self.estimate.reset()

    def __call__(self, reading: Reading) -> Command:
        """Return the duty of each wheel for a reading of the sensors, and advance the integrals by one period."""
        S_hat = np.asarray(self.estimate.slip(reading), dtype=float)
        # An on-board estimate knows the holes itself; otherwise the hole law integrates their depth from the slip.
        self.depth = getattr(self.estimate, "hole", self.depth)
        # The hole law needs the travel speed of each wheel: from the estimate if it has one, else by Eq (1) from S_hat.
        travel: np.ndarray | float = 0.0
        if self.hole and hasattr(self.estimate, "travel"):
            travel = np.asarray(self.estimate.travel(reading))
        elif self.hole:
            ratios = [float(speed_ratio(S)) for S in np.maximum(S_hat, MIN_BRAKING_RATIO - 1.0).tolist()]
            travel = np.asarray(self.hole.r * reading.wheel_rate * ratios)
        inputs = (S_hat, self.integral, self.limit.duty(reading), reading.wheel_rate, travel, self.depth)
        # The law is evaluated for all wheels at once, with one column of inputs for each wheel.
        gains = [float(value) for value in self.gains.values().values()]
        law = _all_wheels_law(len(S_hat), self.hole)
        duty, rate, deepening = np.array(law(np.vstack(np.broadcast_arrays(*inputs)), gains))
        # Integral and depth advance by Euler's method; the next sample uses them.
        self.integral = self.integral + self.period * rate
        self.depth = self.depth + self.period * deepening
        return Command(duty)

    @property
    def expression(self) -> ca.Function:
        """The law of one wheel as a CasADi function, for example for an export as C.

        Its inputs are a vector (S_hat, I, highest duty, wheel rate [rad/s], travel speed v [m/s], hole depth D [m]) and
        the gains. S_hat is the estimated slip and I the integral part of the duty. Its output is (duty, dI/dt, dD/dt).
        """
        return _wheel_law(self.hole)

    def native(self, wheels: int) -> CompiledController | None:
        """Return the control in the form for the compiled simulation loop, which does not call Python.

        The result is None if the slip estimate or the torque limit is a class that a user has written, because its
        Python code must be called. The compiled loop reads and writes `integral` and `depth` of this object.
        """
        limit, known = native_limit(self.limit), type(self.estimate) in (TrueSlip, TableEstimate)
        onboard = self.estimate.native_law(self.hole) if hasattr(self.estimate, "native_law") else None
        if limit is CUSTOM_LIMIT or not (known or onboard):
            return None
        # The compiled loop works on these arrays: the control continues from its memory, and keeps it afterwards.
        self.integral, self.depth = (np.full(wheels, memory, dtype=float) for memory in (self.integral, self.depth))
        gains = [float(value) for value in self.gains.values().values()]
        # Only an estimate by Eq (9) needs a table; the compiled loop knows the true slip itself.
        table = self.estimate.native() if isinstance(self.estimate, TableEstimate) else None
        return CompiledController(
            slip=SlipLaw(_wheel_law(self.hole), gains, self.integral, self.depth, self.period, table),
            limit=limit,
            onboard=onboard,
        )


HOLE_TABLE = "hole"
"""Name of the table with the numbers of the hole law in a TOML file of gains. The wheel radius r is not in this table,
because it is taken from the rover that is driven."""


def save_gains(gains: Gains, path: str | Path, comment: str = "", hole: HoleLaw | None = None) -> Path:
    """Write gains, and the hole law if one is given, to a TOML file. Return the path of the file.

    The file begins with `comment`; each of its lines becomes a comment line of TOML.
    """
    # The wheel radius is left out of the hole law, because it belongs to the rover that will use the gains.
    table: dict[str, Any] = {name: float(value) for name, value in gains.values().items()}
    if hole:
        table |= {HOLE_TABLE: {name: float(value) for name, value in hole.values().items() if name != "r"}}
    return replace_file(path, "".join(f"# {printable(line)}\n" for line in comment.splitlines()) + toml_text(table))


def load_gains(path: str | Path) -> Gains:
    """Return the gains in a TOML file. A gain that is not in the file has its default value.

    Raises DataError: the file is missing or is not TOML. Raises ParameterError: a gain is unknown or out of its bounds.
    """
    table = read_toml(path)
    return record_from(Gains, {name: value for name, value in table.items() if name != HOLE_TABLE}, str(path))


def load_hole(path: str | Path, r: float) -> HoleLaw | None:
    """Return the hole law in a TOML file of gains, for wheels of radius r [m], or None if the file has no hole law.

    Raises DataError: the file is missing or is not TOML.
    Raises ParameterError: a number of the hole law is unknown or out of its bounds.
    """
    table = read_toml(path)
    if HOLE_TABLE not in table:
        return None
    return record_from(HoleLaw, table_in(table, HOLE_TABLE, str(path)), f"{path}: [{HOLE_TABLE}]").replace(r=r)
