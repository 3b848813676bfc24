"""A wheel-rig set whose channels are exactly linear in the fit's coordinates u: every decision in milliseconds.

The model, its effects, the fits and the comparison are the package's own; only the prediction of the rig is a stub.
"""

from dataclasses import dataclass

import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.problem import Prior
from rover_pin.experiments.wheel_rig.calibrate import Setting
from rover_pin.experiments.wheel_rig.data import as_rig_set
from rover_pin.experiments.wheel_rig.fit import rig_space
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.channel import DrawbarPull, Sinkage
from rover_pin.measurements.wheel_rig import WheelRig

LEVELS, REPEATS = 8, 3
RUNS = LEVELS * REPEATS
SD, DEPTH = (0.1, 1e-3), 0.015
MODEL = RigModel(Wheel(), Soil())
FREE = ("phi", "exit_ratio")
PRIOR = {"exit_ratio": Prior(float(Soil().exit_ratio), 0.1)}


@dataclass(frozen=True)
class Law:
    """rows [SD] = slope (u - zero) for one number, in a coordinate that no fit moves."""

    coordinate: object
    zero: float
    slope: np.ndarray


@dataclass(frozen=True)
class LinearEvidence:
    """Channels that are linear in u of each number that has a law; the others, and absent effects, move nothing."""

    rig: WheelRig
    model: RigModel
    laws: dict

    @property
    def channels(self):
        return self.rig.channels

    @property
    def rows(self):
        return [0, 2]

    def predictor(self, free):
        names, sd = self.model.names, np.concatenate([channel.sd for channel in self.channels])

        def channels(fields):
            values, jacobian = np.repeat([0.0, DEPTH], sd.size // 2), np.zeros((sd.size, len(free)))
            for name, law in self.laws.items():
                if name in names:
                    u = law.coordinate.u(fields[names.index(name)])
                    values += sd * law.slope * (u - law.zero)
                    if name in free:
                        jacobian[:, free.index(name)] = sd * law.slope / law.coordinate.slope(u)
            return values, jacobian

        return channels


@dataclass(frozen=True, eq=False)
class LinearSetting(Setting):
    """What stays the same, on the linear rig."""

    laws: dict | None = None

    def evidence(self, model, speeds):
        return LinearEvidence(self.data.rig, model, self.laws)


def law_of(name, slope, model=MODEL):
    """Return the law of a number of the model, zero at the value that it has there."""
    (axis,) = rig_space(model, (name,)).axes
    return Law(axis.coordinate, axis.coordinate.u(float(model.vector()[model.names.index(name)])), slope)


def law_of_size(effect, slope, model=MODEL):
    """Return the law of an effect's only size, zero at its neutral value; u = 1 is the default size."""
    (name,) = effect.neutral
    (axis,) = rig_space(model.having(effect), (f"{type(effect).__name__}.{name}",)).axes
    return {axis.name: Law(axis.coordinate, axis.coordinate.u(effect.neutral[name]), slope)}


def slip():
    return np.repeat(np.linspace(0.0, 0.7, LEVELS), REPEATS)


def rig_set(rows):
    """The set that shows `rows` [2 RUNS] in SDs: drawbar pull about 0, then sinkage about DEPTH."""
    pull, depth = rows.reshape(2, RUNS)
    channels = (DrawbarPull(SD[0] * pull, np.full(RUNS, SD[0])), Sinkage(DEPTH + SD[1] * depth, np.full(RUNS, SD[1])))
    return as_rig_set(WheelRig(Wheel(), slip(), 15.0, channels, name="linear"))


def setting(rows, laws, free=FREE, priors=PRIOR):
    return LinearSetting(rig_set(rows), free, priors, 0, laws)


@dataclass(frozen=True)
class Gaussian:
    """rows = X u + noise of SD 1; u_j is normal about m_j with SD s_j, or anything where s_j is infinite."""

    X: np.ndarray
    y: np.ndarray
    mean: np.ndarray
    sd: np.ndarray

    def solved(self, keep=slice(None)):
        """Return u of least squares on some rows, and chi2 with the priors."""
        known = np.isfinite(self.sd)
        matrix = np.vstack([self.X[keep], np.diag(1 / self.sd)[known]])
        right = np.concatenate([self.y[keep], self.mean[known] / self.sd[known]])
        u = np.linalg.lstsq(matrix, right, rcond=None)[0]
        rest = right - matrix @ u
        return u, float(rest @ rest)

    def covariance(self):
        return np.linalg.inv(self.X.T @ self.X + np.diag(self.sd**-2.0))

    def held_out(self, level):
        """Return the residual of each level, as least squares on the others predict it [channels, runs]."""
        levels, rest = np.tile(level, 2), np.zeros(self.y.size)
        for one in np.unique(level):
            u, _ = self.solved(levels != one)
            rest[levels == one] = self.y[levels == one] - self.X[levels == one] @ u
        return rest.reshape(2, -1)


def gaussian(rows, laws, names, priors=PRIOR):
    """The closed form of a fit of `names` to rows [SD]."""
    columns = [laws[name].slope for name in names]
    zero = sum(laws[name].slope * laws[name].zero for name in names)
    scale = {name: laws[name].coordinate.slope(0.0) for name in names}
    mean = [priors[name].mean / scale[name] if name in priors else 0.0 for name in names]
    sd = [priors[name].sd / scale[name] if name in priors else np.inf for name in names]
    return Gaussian(np.array(columns).T, rows + zero, np.array(mean), np.array(sd))
