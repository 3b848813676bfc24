"""A law of measurable channels compiled with CasADi for all points at once, with its exact Jacobian."""

from collections.abc import Hashable
from functools import lru_cache
from typing import Any, Protocol

import casadi as ca
import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel

FIELDS: tuple[str, ...] = (*quantities(Wheel), *quantities(Soil))
"""Every constant that can be free, in the order in which a prediction takes them."""


class Law(Hashable, Protocol):
    """What is predicted at one point; hashable, so that a law is compiled once."""

    def build(self, condition: Any, wheel: Wheel, soil: Soil, free: Any) -> tuple[Any, Any]:
        """Return the channels [c] at one point and their Jacobian [c, p] with respect to the expressions `free`."""


class CompiledPrediction:
    """A `Predictor`: all points of one data set through one mapped CasADi function, without allocation.

    Parameters
    ----------
    conditions : array [points, inputs]
        What was set at each point, as the law reads it.
    wheel : Wheel
        The wheel of these data; its r and b hold unless they are free.
    """

    def __init__(self, law: Law, conditions: np.ndarray, wheel: Wheel, free: tuple[str, ...]):
        points, inputs = conditions.shape
        function = _mapped(law, free, points, inputs)
        rows = function.size1_out(0)
        self._own = {FIELDS.index(name): float(value) for name, value in wheel.values().items() if name not in free}
        self._conditions = np.ascontiguousarray(conditions, dtype=float)
        self._fields = np.zeros(len(FIELDS))
        self._values = np.zeros((points, rows))
        self._jacobian = np.zeros((points, len(free), rows))
        buffer: Any
        buffer, self._evaluate = function.buffer()
        for place, array in enumerate((self._conditions, self._fields)):
            buffer.set_arg(place, array.data)
        for place, array in enumerate((self._values, self._jacobian)):
            buffer.set_res(place, array.data)
        self._buffer = buffer

    def __call__(self, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the predictions [m], channel by channel, and their Jacobian [m, p] at these values of `FIELDS`."""
        self._fields[:] = fields
        for index, value in self._own.items():
            self._fields[index] = value
        self._evaluate()
        values = self._values.T.flatten()
        return values, np.array(self._jacobian.transpose(2, 0, 1)).reshape(values.size, self._jacobian.shape[1])


@lru_cache(maxsize=64)
def _mapped(law: Law, free: tuple[str, ...], points: int, inputs: int) -> ca.Function:
    condition, fields = ca.SX.sym("condition", inputs), ca.SX.sym("fields", len(FIELDS))
    named = dict(zip(FIELDS, ca.vertsplit(fields), strict=True))
    wheel = Wheel().replace(**{name: named[name] for name in quantities(Wheel)})
    soil = Soil().replace(**{name: named[name] for name in quantities(Soil)})
    wanted = ca.vertcat(*(named[name] for name in free))
    values, jacobian = law.build(condition, wheel, soil, wanted)
    point = ca.Function("point", [condition, fields], [ca.densify(values), ca.densify(jacobian)])
    return point.map("points", "serial", points, [1], [])
