"""The slip control of section 5 (Fig 9): PI on each wheel's duty, limited by the soil's shear; its gains as a file."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.files.toml_file import read_toml, table_in, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.public import brief, public
from rover_pin.base.quantity import Record, quantities, quantity, record_from
from rover_pin.contact import Scalar
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_estimate import SlipEstimate, TableEstimate, TrueSlip
from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import Commands, SlipLaw
from rover_pin.simulation.timing import CONTROL_PERIOD
from rover_pin.soil.slip import speed_ratio

FADE = 0.005
"""Excess of the asked duty over the given one [-] on which the integral comes to rest; at once, it would chatter."""

LEAST_RATIO = 0.05
"""Least rim speed over travel [-] of a wheel that brakes: one that is held slides no faster than 20 times its rim."""


@dataclass(frozen=True)
class Gains(Record):
    """PI gains and limits: delta = delta_0 + k_p e + k_i int e dt, e = S_d - S_hat, within [delta_min, delta_max]."""

    S_d: Scalar = quantity(0.1, "", "paper, section 5", -1.0, 1.0, "S_d")
    k_p: Scalar = quantity(0.1, "", "assumed: not in the paper", 0.0, 100.0, "k_p")
    k_i: Scalar = quantity(1.0, "1/s", "assumed: not in the paper", 0.0, 1000.0, "k_i")
    delta_0: Scalar = quantity(0.55, "", "paper, section 5: cruise duty", -1.0, 1.0, "delta_0")
    delta_min: Scalar = quantity(0.05, "", "assumed: a wheel is never stopped", -1.0, 1.0, "delta_min")
    delta_max: Scalar = quantity(0.55, "", "assumed: the duty without control", -1.0, 1.0, "delta_max")


HOLE_GAINS = Gains(S_d=0.6, k_p=1.65, k_i=10.0)
"""Gains for a `HoleLaw`, set with its numbers on drives that no study counts."""


class Step(NamedTuple):
    """What the PI law gives."""

    duty: Scalar
    "within its limits [-]"
    rate: Scalar
    "of the integral [1/s]"


def pi_law(gains: Gains, S_hat: Scalar, integral: Scalar, highest: Scalar) -> Step:
    """Return the duty of a wheel, and how its integral I moves; floats or expressions.

        e = S_d - S_hat,  asked = delta_0 + k_p e + I,  duty = asked, clipped to [delta_min, min(delta_max, highest)]
        dI/dt = k_i e (1 - min(x / FADE, 1)),  x = max(0, (asked - duty) sign(e))

    The integral rests while the duty is at a limit and e pushes further past it (conditional integration), and goes on
    from there as soon as e turns or the limit gives way. So it cannot wind up on the flat, where the load and not the
    duty sets the slip; without k_i there is none; and a limit that comes and goes leaves no trace in it.

    Parameters
    ----------
    highest : Scalar
        Highest duty that the torque limit allows [-]; delta_min gives way to it.

    Source: section 5, Fig 9. Differs from the paper: it does not say what its integral does at the limit.
    """
    error = gains.S_d - S_hat
    unclamped = gains.delta_0 + gains.k_p * error + integral
    most = ca.fmin(gains.delta_max, highest)
    least = ca.fmin(gains.delta_min, most)
    duty = ca.fmin(ca.fmax(unclamped, least), most)
    outward = ca.fmax((unclamped - duty) * ca.sign(error), 0.0)
    return Step(duty, gains.k_i * error * (1.0 - ca.fmin(outward / FADE, 1.0)))


@lru_cache(maxsize=16)
def _one(hole: HoleLaw | None) -> ca.Function:
    """Return the law of one wheel: (S_hat, integral, highest, rate, v, D), gains -> duty, dI/dt, dD/dt."""
    p, x = ca.SX.sym("gains", len(quantities(Gains))), ca.SX.sym("x", 6)
    gains = Gains(**dict(zip(quantities(Gains), ca.vertsplit(p), strict=True)))
    S_hat, integral, highest, rate, v, D = ca.vertsplit(x)
    deepening = ca.SX(0.0)
    if hole:
        deepening = hole.deepening(v, hole.r * rate, D)
        gains = gains.replace(S_d=hole.desired_slip(gains.S_d, D))
    return ca.Function("pi_law", [x, p], [ca.vertcat(*pi_law(gains, S_hat, integral, highest), deepening)])


@lru_cache(maxsize=16)
def _law(wheels: int, hole: HoleLaw | None) -> ca.Function:
    """Return the law of all wheels, a column a wheel."""
    return _one(hole).map("slip_control", "serial", wheels, [1], [])


@brief
@public
@dataclass
class SlipControl:
    """The control law; sampled every `period` [s], held in between. Keeps one integral a wheel; `reset` clears them.

    delta = delta_0 + k_p (S_d - S_hat) + k_i int (S_d - S_hat) dt for each wheel, held within the gains' and the torque
    limit's bounds.

    Parameters
    ----------
    gains : Gains
        S_d, k_p, k_i, and the duty's middle and bounds.
    estimate : SlipEstimate
        Where S_hat is from: `TrueSlip`, Eq 9's `TableEstimate`, or your own with a `slip(reading)`.
    limit : TorqueLimit or NoLimit
        The greatest duty that the torque check leaves a wheel.
    period : float
        Of sampling [s].
    hole : HoleLaw, optional
        Has S_d fall as a wheel's own hole deepens; without one it is constant.
    integral, depth : array or float
        The integral's part of the duty, and the estimated depth of its hole [m], a wheel each.

    Source: section 5, Fig 9. Differs from the paper: see `pi_law`; its S_d is constant.

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
        """Forget the past."""
        self.integral, self.depth = 0.0, 0.0
        if hasattr(self.estimate, "reset"):
            self.estimate.reset()

    def __call__(self, reading: Reading) -> Command:
        """Return the duty of each wheel."""
        S_hat = np.asarray(self.estimate.slip(reading), dtype=float)
        self.depth = getattr(self.estimate, "hole", self.depth)
        travel = self._travel(self.hole, reading, S_hat) if self.hole else 0.0
        seen = (S_hat, self.integral, self.limit.duty(reading), reading.wheel_rate, travel, self.depth)
        gains = [float(value) for value in self.gains.values().values()]
        duty, rate, deepening = np.array(_law(len(S_hat), self.hole)(np.vstack(np.broadcast_arrays(*seen)), gains))
        self.integral = self.integral + self.period * rate
        self.depth = self.depth + self.period * deepening
        return Command(duty)

    def _travel(self, hole: HoleLaw, reading: Reading, S_hat: np.ndarray) -> np.ndarray:
        """Return the speed of each wheel over the ground [m/s], by Eq (1) from its slip where nothing else is known."""
        if hasattr(self.estimate, "travel"):
            return np.asarray(self.estimate.travel(reading))
        ratios = [float(speed_ratio(S)) for S in np.maximum(S_hat, LEAST_RATIO - 1.0).tolist()]
        return np.asarray(hole.r * reading.wheel_rate * ratios)

    @property
    def expression(self) -> ca.Function:
        """The law of one wheel: (S_hat, integral, highest duty, rate, v, D), gains -> duty, dI/dt, dD/dt."""
        return _one(self.hole)

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop, which keeps the memories; None with your own estimate or limit."""
        limit, known = native_limit(self.limit), type(self.estimate) in (TrueSlip, TableEstimate)
        onboard = self.estimate.native_law(self.hole) if hasattr(self.estimate, "native_law") else None
        if limit is CUSTOM_LIMIT or not (known or onboard):
            return None
        self.integral, self.depth = (np.full(wheels, each, dtype=float) for each in (self.integral, self.depth))
        gains = [float(value) for value in self.gains.values().values()]
        table = self.estimate.native() if isinstance(self.estimate, TableEstimate) else None
        return Commands(
            slip=SlipLaw(_one(self.hole), gains, self.integral, self.depth, self.period, table),
            limit=limit,
            onboard=onboard,
        )


HOLE = "hole"
"""The table of a hole law's numbers; its r is that of the rover that is driven."""


def save_gains(gains: Gains, path: str | Path, comment: str = "", hole: HoleLaw | None = None) -> Path:
    """Write gains as a TOML file, one `name = value` a line; `comment` comes first, as comment lines."""
    table: dict[str, Any] = {name: float(value) for name, value in gains.values().items()}
    if hole:
        table |= {HOLE: {name: float(value) for name, value in hole.values().items() if name != "r"}}
    return replace_file(path, "".join(f"# {line}\n" for line in comment.splitlines()) + toml_text(table))


def load_gains(path: str | Path) -> Gains:
    """Return the gains of a TOML file; those that it does not name keep their defaults.

    Raises DataError: a file that is missing or not TOML.
    Raises ParameterError: an unknown gain, with the close ones, or a value out of its bounds.
    """
    table = read_toml(path)
    return record_from(Gains, {name: value for name, value in table.items() if name != HOLE}, str(path))


def load_hole(path: str | Path, r: float) -> HoleLaw | None:
    """Return the hole law of a file of gains for wheels of radius r [m]; None where S_d is constant.

    Raises DataError, ParameterError: as `load_gains`.
    """
    table = read_toml(path)
    if HOLE not in table:
        return None
    return record_from(HoleLaw, table_in(table, HOLE, str(path)), f"{path}: [{HOLE}]").replace(r=r)
