"""A wheel-rig set whose channels are exactly linear in the fit's coordinates u: every decision in milliseconds.

The model, its effects, the fits and the search are the package's own; only the prediction of the rig is a stub.
"""

from dataclasses import dataclass, field

import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.experiment import Sensitivities
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.channel import DrawbarPull, Sinkage
from rover_pin.measurements.rig_set import RigSet

LEVELS, REPEATS = 8, 3
RUNS = LEVELS * REPEATS
SD, DEPTH = (0.1, 1e-3), 0.015
MODEL = RigModel(Wheel(), Soil())
FREE = ("soil.phi", "soil.exit_ratio")


@dataclass(frozen=True)
class Law:
    """rows [SD] = slope u for one number, u as its parameter has it."""

    parameter: Parameter
    slope: np.ndarray

    def per_u(self, x):
        """dx / du at x."""
        return self.parameter.slope(self.parameter.u(x))


@dataclass(frozen=True, eq=False)
class LinearRig(RigExperiment):
    """Channels that are linear in u of each number that has a law; the others, and absent effects, move nothing."""

    laws: dict = field(default_factory=dict)
    free: tuple = FREE

    def uncertain(self, model):
        return tuple(parameter for parameter in super().uncertain(model) if parameter.name in self.free)

    def sensitivities(self, model, parameters, u):
        values = {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
        rows = np.zeros(2 * RUNS)
        for name, law in self.laws.items():
            if name.rpartition(".")[0] in model.records:
                rows += law.slope * law.parameter.u(values.get(name, self.value(model, name)))
        is_known = [
            (self.laws.get(parameter.name), parameter.slope(x), parameter.value(x))
            for parameter, x in zip(parameters, u, strict=True)
        ]
        none, table = np.zeros(2 * RUNS), self.runs["linear"].table
        slopes = np.array([none if law is None else law.slope * s / law.per_u(x) for law, s, x in is_known])
        return Sensitivities(table(in_units(rows, (0.0, DEPTH))), table(in_units(slopes.reshape(-1, 2 * RUNS))))


def in_units(rows, at=(0.0, 0.0)):
    """Rows [..., 2 RUNS] in SDs as channels (..., channels, runs) in their units, about `at`."""
    channels = rows.reshape(*rows.shape[:-1], 2, RUNS)
    return np.array(SD)[:, None] * channels + np.array(at)[:, None]


def law_of(name, slope):
    """Return the law of an uncertain number of the model, zero at the value that it has there."""
    (parameter,) = [
        parameter
        for parameter in RigExperiment((rig_set(np.zeros(2 * RUNS)),)).uncertain(MODEL)
        if parameter.name == name
    ]
    return Law(parameter, slope)


def slip():
    return np.repeat(np.linspace(0.0, 0.7, LEVELS), REPEATS)


def rig_set(rows):
    """The set that shows `rows` [2 RUNS] in SDs: drawbar pull about 0, then sinkage about DEPTH."""
    pull, depth = rows.reshape(2, RUNS)
    channels = (DrawbarPull(SD[0] * pull, np.full(RUNS, SD[0])), Sinkage(DEPTH + SD[1] * depth, np.full(RUNS, SD[1])))
    speeds = np.column_stack([0.05 * (1 - slip()), np.full(RUNS, 0.05)])
    return RigSet(Wheel(), slip(), 15.0, channels, name="linear", speeds=speeds)


def made(rows, laws, free=FREE):
    """The experiment that shows rows [2 RUNS] in SDs, with these laws."""
    return LinearRig((rig_set(rows),), laws=laws, free=free)
