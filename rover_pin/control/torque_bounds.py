"""Torque bounds of a wheel: the torque at which the soil fails and the torque at a slip limit, and the wheel's pull at
each of these torques.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from rover_pin.base.errors import MissingExtraError, ParameterError
from rover_pin.base.public import public
from rover_pin.base.quantity import is_symbolic
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.control.bound_law import FINAL_NODES, INPUTS, OUTPUTS, bound_law
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.quadrature import entry_graded
from rover_pin.soil.sinkage import ShearState, entry_angle, fully_sheared, slipping
from rover_pin.soil.stress import modulus
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, forces

BY_LOAD = SinkageAngles()
"""Default rule for the contact angles of the torque bounds: the entry angle theta_1 follows from the load."""

SLIP_LIMIT = 0.2
"""Default slip limit S_lim of the torque bounds (assumed). At this slip, traction still increases with slip, and the
wheel digs little."""


class Bounds(NamedTuple):
    """The two torque bounds of a wheel."""

    saturation: Scalar
    """T_sat [N m], the torque if the shear stress equals the soil's strength along the whole contact arc"""
    limit: Scalar
    "T_lim [N m], the torque at which the wheel slips at the slip limit"


class WheelBounds(NamedTuple):
    """The torque bounds of n wheels, and the derivative of each wheel's bound with respect to its own load."""

    saturation: np.ndarray
    "T_sat of each wheel (n,) [N m], the torque at which the soil fails"
    limit: np.ndarray
    "T_lim of each wheel (n,) [N m], the torque at the slip limit"
    d_saturation: np.ndarray
    """dT_sat / dW of each wheel (n,) [m], with the load W of the wheel"""
    d_limit: np.ndarray
    """dT_lim / dW of each wheel (n,) [m], with the load W of the wheel"""


@public
def torque_bounds(
    load: Scalar,
    soil: Soil,
    wheel: Wheel,
    slip_limit: Scalar = SLIP_LIMIT,
    angles: FixedAngles | SinkageAngles = BY_LOAD,
) -> Bounds:
    """Return two torques of a loaded wheel: T_sat, at which the soil fails, and T_lim, at which the slip equals a slip
    limit.

    A controller that keeps the torque below T_lim keeps the slip below the limit S_lim in steady driving, because the
    torque increases with the slip. T_lim is smaller than T_sat. The bounds are

        T_sat = r^2 b int (c + sigma tan phi) dtheta,    T_lim = r^2 b int tau(theta, S_lim) dtheta,

    each integrated over the contact arc on which the normal force f_n of the soil, Eq (6), equals the load. sigma is
    the normal stress at the angle theta, and tau(theta, S) the shear stress at the slip S. c + sigma tan phi is the
    strength of the soil. r and b are the radius and the width of the wheel.

    Parameters
    ----------
    load : Scalar
        Normal load W of the wheel [N], not negative. For a lifted wheel (0 N) both bounds are 0, and they are twice
        differentiable there.
    soil : Soil
        Constants of the soil.
    wheel : Wheel
        Radius r and width b of the wheel [m].
    slip_limit : Scalar
        Slip limit S_lim [-], in (0, 1].
    angles : FixedAngles or SinkageAngles
        With `SinkageAngles` (default), theta_1 follows from the load. With `FixedAngles()`, the contact angles are the
        constants of the soil, as in the paper's F(S) f_n.

    Returns
    -------
    Bounds
        T_sat and T_lim [N m]: floats, or CasADi expressions with exact derivatives if an argument or a field of an
        argument is a CasADi expression.

    Raises
    ------
    ParameterError
        The load is negative or not finite, no theta_1 below 90 deg carries the load, or the slip limit is outside (0,
        1].

    Source: Eqs (2) to (6); section 5, "limit the driving torque not to exceed the maximum share". Differs from the
    paper: the paper gives no formula for the bound, keeps theta_1 constant, and has no bound for a slip limit.

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
    """The torque bounds of n wheels on one soil, prepared for fast evaluation in a control loop.

    A call `bounds(loads)` returns the `WheelBounds` for the loads (n,) [N]. If there is a C compiler, the function is
    compiled on first use, and `compiled` is True. Otherwise CasADi interprets the function, which is slower.

    Parameters
    ----------
    wheels : sequence of Wheel
        The wheels, in the order of the loads that will be given.
    soil : Soil
        Constants of the soil.
    slip_limit : float
        Slip limit S_lim [-], in (0, 1].
    angles : FixedAngles or SinkageAngles
        Rule for the contact angles, as for `torque_bounds`. All constants must be numbers, not CasADi expressions.

    Raises
    ------
    ParameterError
        The slip limit is outside (0, 1], or there are no wheels.

    Examples
    --------
    >>> from rover_pin import SOILS, Wheel
    >>> from rover_pin.control.torque_bounds import TorqueBounds
    >>> bounds = TorqueBounds([Wheel()] * 2, SOILS["table-1"])([9.5, 19.0])
    >>> bool(bounds.limit[1] > bounds.limit[0] > 0.0)
    True
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
            raise ParameterError("TorqueBounds: no wheels are given. Give one Wheel for each load.")
        self.wheels, self.soil = tuple(wheels), soil
        # One row of INPUTS for each wheel. Only the loads change from call to call, and are written into these rows.
        rows = [np.array(ca.DM(_column(0.0, slip_limit, wheel, soil))).ravel() for wheel in wheels]
        self._inputs = np.ascontiguousarray(rows)
        self._loads = self._inputs[:, INPUTS.index("load")]
        self._outputs, self._refused = np.zeros((len(OUTPUTS) - 1, len(rows))), np.zeros(1)
        self.bind(_compiled_bounds(len(rows), angles) or interpreted_bounds(len(rows), angles))

    def bind(self, function: ca.Function) -> None:
        """Let this object evaluate `function`, which is a result of `interpreted_bounds` or its compiled form.

        CasADi reads the inputs from the arrays of this object and writes the outputs into them, because copying the
        arrays at every call would cost more time than the evaluation.
        """
        self._function, self.compiled = function, function.class_name() == "External"
        self._buffer: Any
        self._buffer, self._run = function.buffer()
        self._buffer.set_arg(0, self._inputs.ravel().data)
        self._buffer.set_res(0, self._outputs.ravel().data)
        self._buffer.set_res(1, self._refused.data)

    def __call__(self, loads: ArrayLike) -> WheelBounds:
        """Return the torque bounds of the wheels at their loads (n,) [N], which must not be negative.

        Raises ParameterError: the number of loads differs from the number of wheels, or a load is negative, not finite,
        or too large for the soil.
        """
        # The loads are written into the arrays that the function reads, so nothing is copied.
        try:
            self._loads[:] = loads
        except (TypeError, ValueError):
            raise ParameterError(
                f"Loads of shape {np.shape(loads)} do not fit {len(self.wheels)} wheels: give {len(self.wheels)} "
                "numbers [N], one for each wheel."
            ) from None
        self._run()
        # The function counts the wheels that no entry angle carries; their bounds are meaningless.
        if self._refused[0]:
            _refuse(self._loads.tolist(), self.wheels, self.soil)
        return WheelBounds(*self._outputs.copy())


def interpreted_bounds(n: int, angles: FixedAngles | SinkageAngles) -> ca.Function:
    """Return the function of the torque bounds of n wheels, which CasADi interprets.

    Its input has one column of the quantities `INPUTS` for each wheel. Its first output has four columns with one row
    for each wheel: the torque bounds T_sat and T_lim, and their derivatives with respect to the load. Its second output
    is the number of wheels whose load no entry angle carries.
    """
    x = ca.MX.sym("x", len(INPUTS), n)
    out = bound_law(angles).map(n)(x)
    return ca.Function(f"torque_bounds_{n}", [x], [ca.densify(out[:-1, :].T), ca.sum2(out[-1, :])])


@lru_cache(maxsize=8)
def _compiled_bounds(n: int, angles: FixedAngles | SinkageAngles) -> ca.Function | None:
    """Return the function of `interpreted_bounds`, compiled by the C compiler, or None if there is no C compiler."""
    function = interpreted_bounds(n, angles)
    try:
        library = shared_library(generated_source(function), "bounds")
    except MissingExtraError:
        return None
    return ca.external(function.name(), library._name)


def _column(load: Scalar, slip_limit: Scalar, wheel: Wheel, soil: Soil) -> Any:
    """Return the input of `bound_law` for one wheel, a column of the quantities `INPUTS`."""
    return ca.vertcat(load, slip_limit, *wheel.values().values(), *soil.values().values())


def _check_slip_limit(slip_limit: Scalar) -> None:
    """Raise ParameterError if a slip limit is outside (0, 1]. A CasADi expression cannot be checked and is accepted."""
    if not is_symbolic(slip_limit) and not 0.0 < slip_limit <= 1.0:
        raise ParameterError(
            f"slip_limit = {float(slip_limit):g} is not allowed: the slip of a driven wheel, Eq (1), lies "
            f"in (0, 1]. Give a slip limit in this range, for example {SLIP_LIMIT:g}."
        )


def _refuse(loads: Sequence[float], wheels: Sequence[Wheel], soil: Soil) -> None:
    """Raise the ParameterError that states which of the loads has no torque bound, and why."""
    # The simple faults of a load are reported first: a missing number, and a negative load.
    for i, load in enumerate(loads):
        where = f"load[{i}]" if len(loads) > 1 else "load"
        if not math.isfinite(load):
            raise ParameterError(
                f"{where} = {load:g} N is not a finite number; give the normal load of the wheel in N."
            )
        if load < 0.0:
            raise ParameterError(
                f"{where} = {load:g} N is negative, but soil does not pull a wheel down. Give 0 for a lifted wheel."
            )
    # All loads are finite and not negative, so the largest load is the one that no entry angle carries.
    heaviest = max(range(len(loads)), key=lambda i: loads[i])
    raise ParameterError(
        f"load = {loads[heaviest]:g} N is too large for this soil (k_1 + k_2 b = "
        f"{float(modulus(wheels[heaviest], soil)):g} Pa): no entry angle below 90 deg carries this load. "
        "Lighten the wheel, widen it or choose a firmer soil."
    )


@dataclass(frozen=True)
class TractionLimit:
    """Settings for the pull of a wheel at its torque bounds: slip limit, definition of the load-traction factor, and
    contact angles.
    """

    slip: float = SLIP_LIMIT
    "slip limit S_lim [-], in (0, 1]"
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=NetTraction)
    """definition of the load-traction factor F = f_t / W, pull divided by load"""
    angles: FixedAngles | SinkageAngles = BY_LOAD
    """rule for the contact angles: they follow from the load, or are constants of the soil"""


DEFAULT_LIMIT = TractionLimit()
"""Default settings for the pull at the torque bounds: a slip limit of 0.2, the paper's net traction, and an entry angle
that follows from the load."""


class Pull(NamedTuple):
    """The pull of a wheel, as a force, as a fraction of the load, and as a slope."""

    force: Scalar
    """pull f_t = F W [N], with the load W of the wheel"""
    factor: Scalar
    """load-traction factor F [-], the pull divided by the load"""
    slope: Scalar
    """atan F [rad]: the slope on which the pull just balances the wheel's own load; negative if the wheel cannot move
    even on level ground"""


class BoundPulls(NamedTuple):
    """The pull of a wheel at each of its two torque bounds."""

    saturation: Pull
    """pull at the torque T_sat, at which the soil fails"""
    limit: Pull
    """pull at the torque T_lim, at which the slip equals the slip limit"""


def pull_at_bounds(load: Scalar, soil: Soil, wheel: Wheel, limit: TractionLimit = DEFAULT_LIMIT) -> BoundPulls:
    """Return the pull of a loaded wheel at each of its two torque bounds: T_sat, at which the soil fails, and T_lim, at
    which the slip equals the slip limit.

    The torque bounds themselves do not depend on the definition of the load-traction factor. The definitions differ in
    the pull that results from this torque: T / r (`TorqueTraction`), the horizontal part of the shear stress
    (`GrossTraction`), or this part minus the compaction resistance (`NetTraction`, Eq (7) of the paper). A
    `MotionResistance` of the model is not subtracted.

    Parameters
    ----------
    load : Scalar
        Normal load W of the wheel [N].
    soil, wheel : Soil, Wheel
        Constants of the soil, and radius and width of the wheel [m].
    limit : TractionLimit
        Slip limit, definition of the traction factor, and contact angles.

    Raises
    ------
    ParameterError
        No entry angle below 90 deg carries the load.

    Source: Eqs (6) and (7); section 3.2. Differs from the paper: the paper has only the net form.
    """
    states: tuple[ShearState, ShearState] = (fully_sheared, slipping)
    pulls = []
    for state in states:
        # The arc on which the soil carries the load under this state of shear, unless the soil's angles are fixed.
        if isinstance(limit.angles, FixedAngles):
            theta_1, theta_2 = soil.theta_1, soil.theta_2
        else:
            theta_1 = entry_angle(load, limit.slip, wheel, soil, state=state)
            theta_2 = -soil.exit_ratio * theta_1
        # The stresses along this arc give the forces, and the chosen definition makes the traction factor of them.
        soil_forces = forces(theta_1, theta_2, state(limit.slip, wheel, soil), wheel, soil, entry_graded(FINAL_NODES))
        factor = limit.form.factor(soil_forces, wheel, limit.slip)
        pulls.append(Pull(factor * load, factor, ca.atan(factor)))
    return BoundPulls(*pulls)
