"""Traction-limited torque bounds: the torque at which the soil yields, and that at which a wheel slips too much."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from rover_pin.base.errors import MissingExtraError, ParameterError
from rover_pin.base.public import public
from rover_pin.base.quantity import is_symbolic
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.control.bound_law import INPUTS, OUTPUTS, bound_law
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.stress import modulus

BY_LOAD = SinkageAngles()
"""The arc follows the load: how the bounds are meant."""

SLIP_LIMIT = 0.2
"""Default slip limit (assumed): traction still grows there, and the wheel hardly digs."""


class Bounds(NamedTuple):
    """The two torque bounds of a wheel."""

    saturation: Scalar
    "T_sat [N m]: all of the arc at the soil's greatest shear, c + sigma tan phi"
    limit: Scalar
    "T_lim [N m]: the wheel at its slip limit"


class WheelBounds(NamedTuple):
    """The bounds of n wheels and their derivatives by each wheel's own load."""

    saturation: np.ndarray
    "T_sat, [n] N m"
    limit: np.ndarray
    "T_lim, [n] N m"
    d_saturation: np.ndarray
    "dT_sat / dW, [n] m"
    d_limit: np.ndarray
    "dT_lim / dW, [n] m"


@public
def torque_bounds(
    load: Scalar,
    soil: Soil,
    wheel: Wheel,
    slip_limit: Scalar = SLIP_LIMIT,
    angles: FixedAngles | SinkageAngles = BY_LOAD,
) -> Bounds:
    """Return the torques at which a wheel under a load breaks the soil (T_sat) and reaches its slip limit (T_lim).

    T_sat = r^2 b int (c + sigma tan phi) dtheta, T_lim = r^2 b int tau(theta, S_lim) dtheta, each over the arc whose
    f_n carries the load, Eq (6). T grows with S, so T <= T_lim means S <= S_lim in steady driving, and T_lim < T_sat.

    Parameters
    ----------
    load : Scalar
        Normal load W [N], 0 or more; at 0 (a lifted wheel) both bounds are 0, and smooth (C2) in the load.
    soil : Soil
        Its constants.
    wheel : Wheel
        Its r and b [m].
    slip_limit : Scalar
        S_lim [-], in (0, 1].
    angles : FixedAngles or SinkageAngles
        By default theta_1 follows the load; `FixedAngles()` keeps the soil's, as the paper's F(S) f_n does.

    Returns
    -------
    Bounds
        Floats for floats; expressions where any argument or field is one, with exact derivatives.

    Raises
    ------
    ParameterError
        A negative or not finite load, a slip limit outside (0, 1], a load that no theta_1 below 90 deg carries.

    Source: Eqs (2)-(6); section 5, "limit the driving torque not to exceed the maximum share".
    Differs from the paper: it gives no formula, holds theta_1, and has no slip-limited bound.

    Examples
    --------
    >>> from rover_pin import SOILS, Wheel, torque_bounds
    >>> bounds = torque_bounds(9.5, SOILS["table-1"], Wheel(), slip_limit=0.2)
    >>> round(bounds[0], 3) > round(bounds[1], 3) > 0.0
    True
    """
    _check_slip_limit(slip_limit)
    outputs = bound_law(angles)(_column(load, slip_limit, wheel, soil))
    if not isinstance(outputs, ca.DM):
        return Bounds(outputs[0], outputs[1])
    if float(outputs[4]):
        _refuse([load], [wheel], soil)
    return Bounds(float(outputs[0]), float(outputs[1]))


class TorqueBounds:
    """The bounds of n wheels on one soil, prepared for a control loop: `bounds(loads)` -> `WheelBounds`.

    Compiled on first use where there is a C compiler (`compiled` says so), otherwise run by CasADi, three times slower.

    Parameters
    ----------
    wheels : sequence of Wheel
        One a wheel, in the order of the loads.
    soil, slip_limit, angles
        As for `torque_bounds`; numbers.

    Raises
    ------
    ParameterError
        A slip limit outside (0, 1]; no wheels.
    """

    def __init__(
        self,
        wheels: Sequence[Wheel],
        soil: Soil,
        slip_limit: float = SLIP_LIMIT,
        angles: FixedAngles | SinkageAngles = BY_LOAD,
    ):
        _check_slip_limit(slip_limit)
        if not wheels:
            raise ParameterError("TorqueBounds: no wheels are given; give one Wheel per load.")
        self.wheels, self.soil = tuple(wheels), soil
        rows = [np.array(ca.DM(_column(0.0, slip_limit, wheel, soil))).ravel() for wheel in wheels]
        self._inputs = np.ascontiguousarray(rows)
        self._loads = self._inputs[:, INPUTS.index("load")]
        self._outputs, self._refused = np.zeros((len(OUTPUTS) - 1, len(rows))), np.zeros(1)
        self.bind(_compiled_bounds(len(rows), angles) or interpreted_bounds(len(rows), angles))

    def bind(self, function: ca.Function) -> None:
        """Let `function`, made by `interpreted_bounds` or compiled from it, read and write this object's arrays."""
        self._function, self.compiled = function, function.class_name() == "External"
        self._buffer: Any
        self._buffer, self._run = function.buffer()
        self._buffer.set_arg(0, self._inputs.ravel().data)
        self._buffer.set_res(0, self._outputs.ravel().data)
        self._buffer.set_res(1, self._refused.data)

    def __call__(self, loads: ArrayLike) -> WheelBounds:
        """Return the bounds at the loads [n] N, all 0 or more.

        Raises ParameterError: a negative or not finite load, another number of loads, or a load that the soil cannot
        carry; it says where.
        """
        try:
            self._loads[:] = loads
        except (TypeError, ValueError):
            raise ParameterError(
                f"loads of shape {np.shape(loads)} do not fit: give {len(self.wheels)} numbers [N], one a wheel."
            ) from None
        self._run()
        if self._refused[0]:
            _refuse(self._loads.tolist(), self.wheels, self.soil)
        return WheelBounds(*self._outputs.copy())


def interpreted_bounds(n: int, angles: FixedAngles | SinkageAngles) -> ca.Function:
    """Return the function of the inputs of n wheels: outputs [n, 4], and how many are refused."""
    x = ca.MX.sym("x", len(INPUTS), n)
    out = bound_law(angles).map(n)(x)
    return ca.Function(f"torque_bounds_{n}", [x], [ca.densify(out[:-1, :].T), ca.sum2(out[-1, :])])


@lru_cache(maxsize=8)
def _compiled_bounds(n: int, angles: FixedAngles | SinkageAngles) -> ca.Function | None:
    """Return the same compiled, or None where there is no compiler."""
    function = interpreted_bounds(n, angles)
    try:
        library = shared_library(generated_source(function), "bounds")
    except MissingExtraError:
        return None
    return ca.external(function.name(), library._name)


def _column(load: Scalar, slip_limit: Scalar, wheel: Wheel, soil: Soil) -> Any:
    return ca.vertcat(load, slip_limit, *wheel.values().values(), *soil.values().values())


def _check_slip_limit(slip_limit: Scalar) -> None:
    if not is_symbolic(slip_limit) and not 0.0 < slip_limit <= 1.0:
        raise ParameterError(
            f"slip_limit = {float(slip_limit):g} cannot be reached: the slip of a driving wheel, Eq (1), lies "
            f"in (0, 1]; give one there, for example {SLIP_LIMIT:g}."
        )


def _refuse(loads: Sequence[float], wheels: Sequence[Wheel], soil: Soil) -> None:
    """Say why there is no bound."""
    for i, load in enumerate(loads):
        where = f"load[{i}]" if len(loads) > 1 else "load"
        if not math.isfinite(load):
            raise ParameterError(
                f"{where} = {load:g} N is not a finite number; give the normal load of the wheel in N."
            )
        if load < 0.0:
            raise ParameterError(
                f"{where} = {load:g} N is negative: soil does not pull a wheel down; give 0 for a lifted wheel."
            )
    heaviest = max(range(len(loads)), key=lambda i: loads[i])
    raise ParameterError(
        f"load = {loads[heaviest]:g} N is too much for this soil (k_1 + k_2 b = "
        f"{float(modulus(wheels[heaviest], soil)):g} Pa): no entry angle below 90 deg carries it; "
        "lighten the wheel, widen it or choose a firmer soil."
    )
