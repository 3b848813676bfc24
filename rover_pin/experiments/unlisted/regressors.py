"""What an unknown effect may depend on: functions of measured signals, as few columns that multiply a perturbation."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.unlisted.actions import READING, TORQUE, VOLTAGE, Act, Part, Scene

HAT, INSTANT = 0.1, 1.0
"""Distance of the nodes of a function of place [m] and of time [s]."""
WAVELENGTHS = (0.1, 0.12, 0.14, 0.165, 0.19, 0.22, 0.25, 0.28, 0.32, 0.36, 0.41, 0.46, 0.52)
"""Wavelengths of a periodic ground [m]: a tenth or so apart, as far as a run of two metres tells them."""
GRID = 25
"""Points of an estimated function that is not piecewise linear."""


class Polynomial(NamedTuple):
    """1, z, z^2, ... with z = (value - centre) / half."""

    centre: float
    half: float
    degree: int

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the columns (k, T)."""
        scaled = (np.asarray(values) - self.centre) / self.half
        return np.array([scaled**power for power in range(self.degree + 1)])

    @property
    def grid(self) -> np.ndarray:
        """Values at which the function is shown."""
        return self.centre + self.half * np.linspace(-1, 1, GRID)


class Hats(NamedTuple):
    """Piecewise linear between nodes."""

    nodes: tuple[float, ...]

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the columns (k, T)."""
        return np.array([np.interp(values, self.nodes, row) for row in np.eye(len(self.nodes))])

    @property
    def grid(self) -> np.ndarray:
        """Values at which the function is shown: the nodes."""
        return np.array(self.nodes)


class Wave(NamedTuple):
    """Sine and cosine of 2 pi value / length."""

    length: float

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the columns (2, T)."""
        turn = 2 * math.pi / self.length * np.asarray(values)
        return np.array([np.sin(turn), np.cos(turn)])

    @property
    def grid(self) -> np.ndarray:
        """Values at which the function is shown: one period."""
        return np.linspace(0, self.length, GRID)


Basis = Polynomial | Hats | Wave
Signal = Callable[[Scene, int, Part], np.ndarray]


class Argument(NamedTuple):
    """What a function is of: a signal of a part in a run, the function's form, and whether each run has its own."""

    name: str
    unit: str
    signal: Signal
    basis: Basis
    per_run: bool = False
    "whether every run has its own numbers"

    def shares(self, scene: Scene, act: Act, run: int) -> np.ndarray:
        """Return the columns (k, parts, T) by which the parts act in a run."""
        return np.stack([self.basis.of(self.signal(scene, run, part)) for part in act.parts], axis=1)


def arguments(scene: Scene, act: Act) -> tuple[Argument, ...]:
    """Return what a change of this act may depend on, with ranges as the runs have them."""
    if act.kind == READING:
        return tuple(_of_reading(scene, act))
    of_one_wheel = act.kind in (TORQUE, VOLTAGE) and len(act.parts) == 1
    return (*_common(scene, act), *(ANGLES if of_one_wheel else WAVES))


def _of_reading(scene: Scene, act: Act) -> list[Argument]:
    (part,) = act.parts
    angles = ANGLES[:1] if len(part.wheels) == 1 else ()
    reading = Argument(
        "its own value", act.unit, lambda scene, run, part: scene.replayed_row(run, act.where), Polynomial(0.0, 1.0, 1)
    )
    return [reading, *angles, *_smooth(scene, act, ("duty", "time", "place")), _instants(scene)]


def _common(scene: Scene, act: Act) -> list[Argument]:
    """Return the arguments that torques, forces and grip share."""
    constant = Argument("nothing", "", _time, Polynomial(0.0, 1.0, 0))
    heading = Argument("heading", "", _heading, Polynomial(0.0, 1.0, 1))
    runs = constant._replace(name="run", per_run=True)
    smooth = ["rate", "duty", "slip", "current", "pitch", "roll", "time", "place"]
    return [constant, runs, heading, *_smooth(scene, act, smooth), _places(scene, act), _instants(scene)]


def _heading(scene: Scene, run: int, part: Part) -> np.ndarray:
    return np.asarray(np.cos(scene.experiment.runs[run].heading))


def _time(scene: Scene, run: int, part: Part) -> np.ndarray:
    t = scene.experiment.runs[run].commands.t
    return np.asarray(t - t[0])


def _place(scene: Scene, run: int, part: Part) -> np.ndarray:
    return scene.place(run, part)


def _duty(scene: Scene, run: int, part: Part) -> np.ndarray:
    at = [scene.wheels.index(wheel) for wheel in part.wheels]
    return np.asarray(scene.experiment.runs[run].commands.duty[:, at].mean(axis=1))


def _replayed_signal(channel: str) -> Signal:
    """Return a mean over a part's wheels as replayed: the noise of a measured one would explain itself."""
    return lambda scene, run, part: np.mean([scene.replayed_row(run, channel.format(w)) for w in part.wheels], axis=0)


def _logged_signal(channel: str) -> Signal:
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
"""Signals of which a change may be a smooth function, with their units."""
DEGREE = 2


def _range(scene: Scene, act: Act, signal: Signal) -> tuple[float, float]:
    """Return centre and half of the range of a signal over all runs."""
    values = np.concatenate(
        [signal(scene, run, part) for run, _ in enumerate(scene.experiment.runs) for part in act.parts]
    )
    low, high = np.percentile(values, [1, 99])
    return float(low + high) / 2, max(float(high - low) / 2, 1e-9)


def _smooth(scene: Scene, act: Act, names: Sequence[str]) -> list[Argument]:
    smooth_arguments = []
    for name in names:
        unit, signal = SMOOTH[name]
        centre, half = _range(scene, act, signal)
        if half > 1e-6:
            smooth_arguments.append(Argument(name, unit, signal, Polynomial(centre, half, DEGREE)))
    return smooth_arguments


def _angle(scene: Scene, run: int, part: Part) -> np.ndarray:
    """Return the angle that the part's wheel has turned since the run began [rad]."""
    rate, period = scene.rate(run, part.wheels), scene.experiment.runs[run].commands.period
    return np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * period)])


TURN = Argument("wheel angle", "rad", _angle, Wave(2 * math.pi), per_run=True)
ANGLES = (
    TURN,
    TURN._replace(name="wheel angle since the start", per_run=False),
    TURN._replace(name="twice the wheel angle", basis=Wave(math.pi)),
)
WAVES = tuple(Argument("periodic place", "m", _place, Wave(length)) for length in WAVELENGTHS)


def _places(scene: Scene, act: Act) -> Argument:
    centre, half = _range(scene, act, _place)
    count = max(3, math.ceil(2 * half / HAT) + 1)
    return Argument("local place", "m", _place, Hats(tuple(np.linspace(centre - half, centre + half, count))))


def _instants(scene: Scene) -> Argument:
    """Return a free function of time in every run."""
    last = max(float(run.commands.t[-1] - run.commands.t[0]) for run in scene.experiment.runs)
    nodes = tuple(np.linspace(0.0, last, max(3, math.ceil(last / INSTANT) + 1)))
    return Argument("moment", "s", _time, Hats(nodes), per_run=True)
