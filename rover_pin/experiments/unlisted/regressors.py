"""Functions that an unknown effect may follow: each consists of a signal, such as the slip, and the form of the
function.

An action, such as a torque on one wheel, changes the simulated channels. This change times a function of a signal is
one term that may describe a residual. Each form is a sum of a few basis functions, so that it is linear in its unknown
numbers.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.unlisted.actions import READING, TORQUE, VOLTAGE, Act, Part, Scene

PLACE_SPACING, TIME_SPACING = 0.1, 1.0
"""Distance between the nodes of a piecewise linear function of place [m], and of a piecewise linear function of time
[s]."""
WAVELENGTHS = (0.1, 0.12, 0.14, 0.165, 0.19, 0.22, 0.25, 0.28, 0.32, 0.36, 0.41, 0.46, 0.52)
"""Wavelengths of a periodic terrain that are tried [m]. Neighbouring wavelengths differ by about 15 %, which a run of
two metres can just distinguish."""
GRID_POINTS = 25
"""Number of points at which a smooth function is evaluated for reports."""
DEGREE = 2
"""Degree of the polynomials that describe how an effect depends on a smooth signal."""
MIN_HALF_RANGE = 1e-6
"""Minimum half range of a signal over all runs. If the half range is smaller, the signal counts as constant, and no
function of it is tried."""


class Polynomial(NamedTuple):
    """Polynomial of a signal, with the basis functions 1, z, z^2 and so on, where z is the scaled signal.

    The scaled signal is z = (value - centre) / half, so that it lies between -1 and 1.
    """

    centre: float
    half: float
    degree: int

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the basis functions at T values of the signal (degree + 1, T)."""
        scaled = (np.asarray(values) - self.centre) / self.half
        return np.array([scaled**power for power in range(self.degree + 1)])

    @property
    def grid(self) -> np.ndarray:
        """Values of the signal at which the polynomial is evaluated for reports."""
        return self.centre + self.half * np.linspace(-1, 1, GRID_POINTS)


class Hats(NamedTuple):
    """Piecewise linear function of a signal, as a sum of hat functions. Each hat function is 1 at one node and 0 at all
    others.
    """

    nodes: tuple[float, ...]

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the hat functions at T values of the signal (nodes, T)."""
        return np.array([np.interp(values, self.nodes, row) for row in np.eye(len(self.nodes))])

    @property
    def grid(self) -> np.ndarray:
        """Values of the signal at which the function is evaluated for reports: the nodes of the function."""
        return np.array(self.nodes)


class Wave(NamedTuple):
    """Periodic function of a signal with unknown amplitude and phase, as a sum of sine and cosine of 2 pi value /
    length.
    """

    length: float

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the values of sine and cosine at T values of the signal (2, T)."""
        turn = 2 * math.pi / self.length * np.asarray(values)
        return np.array([np.sin(turn), np.cos(turn)])

    @property
    def grid(self) -> np.ndarray:
        """Values of the signal at which the function is evaluated for reports: from 0 to `length`, one period of the
        function.
        """
        return np.linspace(0, self.length, GRID_POINTS)


Basis = Polynomial | Hats | Wave
"""Form of a function of a signal: a sum of a few basis functions, each multiplied by an unknown number."""
Signal = Callable[[Scene, int, Part], np.ndarray]
"""Function that returns a signal in each row of a run (rows,). Its arguments are the fitted model with its runs, the
index of the run, and a part of an action."""


class Argument(NamedTuple):
    """A function that an unknown effect may follow: the signal on which it depends, and the form of the function."""

    name: str
    unit: str
    signal: Signal
    basis: Basis
    per_run: bool = False
    """whether the unknown numbers of the function differ from run to run"""

    def shares(self, scene: Scene, act: Act, run: int) -> np.ndarray:
        """Return the values of the k basis functions in one run, for each part of an action (k, parts, rows).

        The change of the channels by one unit of a part is multiplied by these values.
        """
        return np.stack([self.basis.of(self.signal(scene, run, part)) for part in act.parts], axis=1)


def arguments(scene: Scene, act: Act) -> tuple[Argument, ...]:
    """Return the functions of signals that an unknown effect with the given action may follow.

    The functions cover the ranges of the signals in the runs. Torques, duties, forces and grips may depend on signals
    of the motion. An error of a reading may depend on the reading itself, on the duty, on time and on place. Functions
    of a wheel's angle are tried only for actions on a single wheel.
    """
    # An error of a reading can be an offset or a gain, or can depend on the wheel's angle, on duty, time and place.
    if act.kind == READING:
        (part,) = act.parts
        reading = Argument(
            "its own value",
            act.unit,
            lambda scene, run, part: scene.replayed_row(run, act.where),
            Polynomial(0.0, 1.0, 1),
        )
        angles = ANGLES[:1] if len(part.wheels) == 1 else ()
        return (reading, *angles, *_smooth(scene, act, ("duty", "time", "place")), _instants(scene))
    constant = Argument("nothing", "", _time, Polynomial(0.0, 1.0, 0))
    common = [
        constant,
        constant._replace(name="run", per_run=True),
        Argument(
            "heading",
            "",
            lambda scene, run, part: np.asarray(np.cos(scene.experiment.runs[run].heading)),
            Polynomial(0.0, 1.0, 1),
        ),
        *_smooth(scene, act, tuple(SMOOTH)),
    ]
    # A local change of the terrain is a piecewise linear function of the place.
    centre, half = _range(scene, act, _place)
    count = max(3, math.ceil(2 * half / PLACE_SPACING) + 1)
    nodes = tuple(np.linspace(centre - half, centre + half, count))
    common += [Argument("local place", "m", _place, Hats(nodes)), _instants(scene)]
    # The angle of one wheel says nothing about the other wheels, so all wheels together get waves of the place instead.
    is_of_one_wheel = act.kind in (TORQUE, VOLTAGE) and len(act.parts) == 1
    return (*common, *(ANGLES if is_of_one_wheel else WAVES))


def _time(scene: Scene, run: int, part: Part) -> np.ndarray:
    """Return the time since the run began, in each row of a run [s] (rows,)."""
    t = scene.experiment.runs[run].commands.t
    return np.asarray(t - t[0])


def _place(scene: Scene, run: int, part: Part) -> np.ndarray:
    """Return the x coordinate of the wheels on which the action acts, in each row of a run [m] (rows,). If the action
    acts on all wheels, the result is the x coordinate of the base.
    """
    return scene.place(run, part)


def _duty(scene: Scene, run: int, part: Part) -> np.ndarray:
    """Return the mean duty of the wheels on which the action acts, in each row of a run (rows,)."""
    columns = [scene.wheels.index(wheel) for wheel in part.wheels]
    return np.asarray(scene.experiment.runs[run].commands.duty[:, columns].mean(axis=1))


def _replayed_signal(channel: str) -> Signal:
    """Return a function that gives a simulated channel as a signal, averaged over the wheels on which the action acts.

    The simulated channel is used instead of the measured one, because a measured channel contains the noise that it has
    to explain.
    """
    return lambda scene, run, part: np.mean([scene.replayed_row(run, channel.format(w)) for w in part.wheels], axis=0)


def _logged_signal(channel: str) -> Signal:
    """Return the signal that is a measured channel of the body, or the simulated channel if the log does not have
    it.
    """
    return lambda scene, run, part: scene.logged_row(run, channel)


SMOOTH: dict[str, tuple[str, Signal]] = {
    "rate": ("rad/s", _replayed_signal("wheel_rate_{}")),
    "duty": ("", _duty),
    "slip": ("", _replayed_signal("slip_{}")),
    "current": ("A", _replayed_signal("current_{}_A")),
    "pitch": ("rad", _logged_signal("body_pitch")),
    "roll": ("rad", _logged_signal("body_roll")),
    "time": ("s", _time),
    "place": ("m", _place),
}
"""Name of a signal on which an effect may depend by a polynomial -> its unit, and the signal."""


def _range(scene: Scene, act: Act, signal: Signal) -> tuple[float, float]:
    """Return the centre and half the width of a signal's range (1st to 99th percentile), over all runs and all parts of
    an action.
    """
    # The percentiles ignore single outliers of the signal.
    values = np.concatenate(
        [signal(scene, run, part) for run, _ in enumerate(scene.experiment.runs) for part in act.parts]
    )
    low, high = np.percentile(values, [1, 99])
    return float(low + high) / 2, max(float(high - low) / 2, 1e-9)


def _smooth(scene: Scene, act: Act, names: Sequence[str]) -> list[Argument]:
    """Return polynomials of the named signals of `SMOOTH` as possible functions of an effect. Constant signals are
    omitted.
    """
    smooth_arguments = []
    for name in names:
        unit, signal = SMOOTH[name]
        centre, half = _range(scene, act, signal)
        if half > MIN_HALF_RANGE:
            smooth_arguments.append(Argument(name, unit, signal, Polynomial(centre, half, DEGREE)))
    return smooth_arguments


def _angle(scene: Scene, run: int, part: Part) -> np.ndarray:
    """Return the angle [rad] (rows,) by which the wheel on which the action acts has turned since the run began, in
    each row.

    The angle is the integral of the measured wheel rate, by the trapezoidal rule.
    """
    rate, period = scene.rate(run, part.wheels), scene.experiment.runs[run].commands.period
    return np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * period)])


TURN = Argument("wheel angle", "rad", _angle, Wave(2 * math.pi), per_run=True)
ANGLES = (
    TURN,
    TURN._replace(name="wheel angle since the start", per_run=False),
    TURN._replace(name="twice the wheel angle", basis=Wave(math.pi)),
)
"""Periodic functions of one wheel's angle, in three forms: with a phase of its own in each run; with one phase in all
runs, for a wheel that starts every run at one angle; and with two periods in a turn."""
WAVES = tuple(Argument("periodic place", "m", _place, Wave(length)) for length in WAVELENGTHS)
"""Periodic functions of the place, one for each wavelength that is tried."""


def _instants(scene: Scene) -> Argument:
    """Return a piecewise linear function of the time in a run as a possible function of an effect; it differs from run
    to run.
    """
    # The nodes extend to the end of the longest run.
    last = max(float(run.commands.t[-1] - run.commands.t[0]) for run in scene.experiment.runs)
    nodes = tuple(np.linspace(0.0, last, max(3, math.ceil(last / TIME_SPACING) + 1)))
    return Argument("moment", "s", _time, Hats(nodes), per_run=True)
