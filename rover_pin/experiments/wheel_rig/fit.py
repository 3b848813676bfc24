"""Fitting a rig model, extra effects included: least squares that one stray run does not bend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rover_pin.contact import Wheel
from rover_pin.effects.effect import Effect
from rover_pin.errors import OptimisationError
from rover_pin.estimation.coordinates import Axis, Linear, Log, Space
from rover_pin.estimation.descent import descend
from rover_pin.estimation.problem import Prior, Problem
from rover_pin.experiments.wheel_rig.model import UNBALANCED, RigModel, conditions, predictor
from rover_pin.identification.soil_space import space
from rover_pin.measurements.channel import Channel, DrawbarPull, Predictor, RigChannel, SideForce, Sinkage, Torque
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.quantity import quantities

STRAY = 4.0
"""Residuals beyond this many (widened) SDs count linearly, not squared."""

ROWS: tuple[type[RigChannel], ...] = (DrawbarPull, Torque, Sinkage, SideForce)
"""The channels in the order in which a rig model predicts them."""


@dataclass(frozen=True, eq=False)
class RigEvidence:
    """A rig set as a given model structure predicts it: `Evidence` whose parameters are `model.names`."""

    rig: WheelRig
    model: RigModel
    speeds: np.ndarray | None = field(default=None, repr=False)

    tells = WheelRig.tells
    told_by = WheelRig.told_by

    @property
    def wheel(self) -> Wheel:
        """The wheel that was used."""
        return self.rig.wheel

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The measured channels."""
        return self.rig.channels

    @property
    def loads(self) -> np.ndarray:
        """Vertical loads [N]."""
        return self.rig.loads

    @property
    def rows(self) -> list[int]:
        """Which of the predicted channels were measured."""
        return [ROWS.index(type(channel)) for channel in self.rig.channels]

    def predictor(self, free: tuple[str, ...]) -> Predictor:
        """Return the measured channels and their Jacobian; not a number where no sinkage carries a load."""
        runs = conditions(self.rig.load, self.rig.slip, self.speeds, self.rig.slip_angle)
        predict, rows = predictor(self.model, free, runs), self.rows

        def channels(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            values, jacobian, error = predict(vector)
            carried = np.where(np.abs(error) < UNBALANCED, 1.0, np.nan)
            return (values[rows] * carried).ravel(), jacobian[rows].reshape(len(rows) * len(runs), len(free))

        return channels


def rig_space(model: RigModel, free: Sequence[str]) -> Space:
    """Return the space of `free` parameters of a rig model: soil and wheel as in any fit, then effects' own."""
    ground = tuple(name for name in free if "." not in name)
    axes = {axis.name: axis for axis in space(ground, model.wheel, model.soil).axes} if ground else {}
    owners = {type(effect).__name__: effect for effect in model.effects}
    for name in free:
        if "." in name:
            kind, _, quantity = name.partition(".")
            axes[name] = _effect_axis(name, owners[kind], quantity)
    return Space(tuple(axes[name] for name in free), model.vector(), model.names)


def _effect_axis(name: str, effect: Effect, quantity: str) -> Axis:
    """Return the axis of an effect's parameter: scaled where it has a neutral value, else a logarithm if positive."""
    about = quantities(effect)[quantity]
    default = float(quantities_of(type(effect))[quantity])
    if quantity not in effect.neutral and about.low > 0:
        return Axis(name, about, Log(), float(np.log(about.low)), float(np.log(about.high)))
    scale = abs(default - effect.neutral.get(quantity, 0.0)) or 1.0
    span = about.high - about.low
    widest = (span / 4 if np.isfinite(span) else 4 * scale) / scale
    return Axis(name, about, Linear(scale, widest), about.low / scale, about.high / scale)


def quantities_of(kind: type[Effect]) -> dict[str, float]:
    """Return the default values of an effect's quantities."""
    return {name: float(value) for name, value in kind().values().items()}


class RigProblem(Problem):
    """The problem of a rig fit: rows can be left out, and strays count linearly (Huber)."""

    data: tuple[RigEvidence, ...]

    def __init__(
        self,
        evidence: RigEvidence,
        space: Space,
        priors: Mapping[str, Prior],
        widen: float = 1.0,
        keep: np.ndarray | None = None,
    ):
        stated = {name: prior for name, prior in priors.items() if name in space.names}
        super().__init__((evidence,), space, stated)
        self.sd = widen * self.sd
        self.widen = widen
        self.keep = np.ones(self.measured.size, dtype=bool) if keep is None else keep

    def widened(self, factor: float) -> RigProblem:
        """Return the same problem with the data's stated standard deviations multiplied by `factor`."""
        return RigProblem(self.data[0], self.space, self.priors, factor, self.keep)

    def keeping(self, runs: np.ndarray) -> RigProblem:
        """Return the same problem on some runs only, a mask [runs]."""
        keep = np.tile(runs, len(self.data[0].channels))
        return RigProblem(self.data[0], self.space, self.priors, self.widen, keep)

    @property
    def freedom(self) -> int:
        """Rows minus parameters."""
        return int(self.keep.sum()) + len(self.priors) - len(self.space.names)

    def evaluate(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows whose squares sum to the robust chi2, and their Jacobian."""
        residual, jacobian = super().evaluate(u)
        count = self.measured.size
        size = np.abs(residual[:count])
        stray = size > STRAY
        root = np.sqrt(np.where(stray, 2 * STRAY * size - STRAY**2, 1.0))
        slope = self.keep * np.where(stray, STRAY / root, 1.0)
        residual[:count] = self.keep * np.where(stray, np.sign(residual[:count]) * root, residual[:count])
        jacobian[:count] *= slope[:, None]
        return residual, jacobian

    def plain(self, u: np.ndarray) -> np.ndarray:
        """Return the residuals over their SD of all rows, left out or not."""
        return super().evaluate(u)[0][: self.measured.size]


@dataclass(frozen=True, eq=False)
class RigFit:
    """A model fitted to a rig set; `model` carries the fitted values."""

    problem: RigProblem = field(repr=False)
    u: np.ndarray = field(repr=False)
    chi2: float
    model: RigModel

    @property
    def residual(self) -> np.ndarray:
        """Residuals over their stated SD, channel by channel [channels, runs]."""
        plain = self.problem.plain(self.u) * self.problem.widen
        return plain.reshape(len(self.problem.data[0].channels), -1)

    @property
    def misfit(self) -> float:
        """chi2 per degree of freedom, in stated SDs."""
        return self.chi2 * self.problem.widen**2 / max(self.problem.freedom, 1)

    def value(self, name: str) -> float:
        """Return the fitted value of a parameter [SI]."""
        return float(self.model.vector()[self.model.names.index(name)])


def fit_from(problem: RigProblem, starts: Sequence[np.ndarray]) -> RigFit:
    """Return the best of the descents from several starts.

    Raises
    ------
    OptimisationError
        None of them ended.
    """
    best, said = None, ""
    for start in starts:
        try:
            u, chi2 = descend(problem, np.clip(start, problem.space.low, problem.space.high))
        except (OptimisationError, np.linalg.LinAlgError) as error:
            said = str(error)
            continue
        if best is None or chi2 < best[1]:
            best = (u, chi2)
    if best is None:
        raise OptimisationError(f"no start of the fit converged: {said}", status=said)
    model = problem.data[0].model.at(problem.space.fields(best[0]))
    return RigFit(problem, best[0], best[1], model)


def spread_starts(problem: RigProblem, count: int, seed: int) -> list[np.ndarray]:
    """Return the model's own values, then points scattered around them."""
    centre = problem.space.start()
    spread = np.array([axis.coordinate.spread for axis in problem.space.axes])
    draws = np.random.default_rng(seed).uniform(-1, 1, (count - 1, len(centre)))
    return [centre, *np.clip(centre + draws * spread, problem.space.low, problem.space.high)]
