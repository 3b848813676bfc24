"""Traction factors by slip as an experiment: points as of Fig 6, of a CSV file or worked out from a drive log."""

from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.standalone import Parts, Standalone
from rover_pin.estimation.experiment import Differentiable, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter, parameter_of
from rover_pin.experiments.soil_priors import known_constant, unknown_constant
from rover_pin.experiments.wheel_rig.steady_law import FIELDS, with_values_of
from rover_pin.measurements.traction_points import TractionPoints, read_traction_points
from rover_pin.parameters import TABLE_1
from rover_pin.soil.sinkage import fitted_entry_angle
from rover_pin.soil.wheel_forces import load_traction_factor

SOUGHT = ("k", "phi")
"""What Fig 6's points are drawn for: nothing is known of these beforehand."""
MODULUS_BY_WIDTH = "k_2"
"""Of one wheel k_1 stands for all of k_1 + k_2 b."""
ENTERS = 1e-9
"""SDs of a point that the prior SD of a constant moves where the constant does not enter at all."""


@lru_cache(maxsize=64)
def factor_law(form: Any, angles: Any, loaded: bool, free: tuple[str, ...], points: int) -> ca.Function:
    """Return (S and W of each point, constants) -> columns of F, dF/dS, and the slope of F by each `free` one.

    The arc is at the soil's theta_1, or where `loaded` at that which carries the point's load.
    """
    condition, constants, slip = ca.SX.sym("condition", 2), ca.SX.sym("constants", len(FIELDS)), ca.SX.sym("S")
    wheel, soil, _ = with_values_of((), constants)
    if loaded:
        soil = soil.replace(theta_1=fitted_entry_angle(condition[1], slip, wheel, soil))
    law = load_traction_factor(slip, soil, wheel, form, angles)
    values = ca.substitute(ca.vertcat(law, ca.jacobian(law, slip)), slip, condition[0])
    wanted = ca.vertcat(*(constants[FIELDS.index(name)] for name in free)) if free else ca.SX(0, 1)
    column = ca.densify(ca.vertcat(values, ca.jacobian(values[0], wanted).T))
    return ca.Function("point", [condition, constants], [column]).map("points", "serial", points, [1], [])


@dataclass(frozen=True)
class PointErrors(Record):
    """Errors that all points share, each in its own SDs."""

    common_factor: Scalar = quantity(0.0, "", "assumed: loads and the torque constant are wrong together", -10, 10)
    common_slip: Scalar = quantity(0.0, "", "assumed: rates and radii are wrong together", -10.0, 10.0)


@lru_cache(maxsize=16)
def slip_errors(count: int) -> Any:
    """Return a record with the error of each point's slip, in its own SD."""
    errors = [
        (f"point_{at + 1}", float, quantity(0.0, "", "declared: the SD of its slip", -10, 10)) for at in range(count)
    ]
    return make_dataclass("SlipErrors", errors, bases=(Record,), frozen=True)()


class Shift(NamedTuple):
    """A number with which the points were worked out, and d factor / d u of each point [points]."""

    parameter: Parameter
    effect: np.ndarray


@dataclass(frozen=True, eq=False)
class TractionFactors(Standalone, Differentiable):
    """Points at slips S, each with the SD of its mean; `declared` is the model that comes with them.

    Each true slip is S + a xi, xi ~ N(0, 1), a number like the others: taken as exact, noisy slips flatten the curve
    (regression dilution). What all points share, of slips and factors, is a number too; `shifts` are further ones.

    Source: Deming, Statistical Adjustment of Data (1943); York et al., American Journal of Physics 72 (2004) 367.
    """

    points: TractionPoints
    declared: Parts = field(repr=False)
    shifts: tuple[Shift, ...] = field(default=(), repr=False)
    name: str = "traction factors"
    channels = ("traction factor",)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the points of a CSV file, in a soil as of Table 1 where nothing else is said."""
        points = read_traction_points(path)
        return cls(points, Parts({"soil": TABLE_1, "wheel": points.wheel}), name=path.stem)

    @property
    def folds(self) -> tuple[str, ...]:
        """Every point by itself."""
        return tuple(f"point {number + 1}" for number in range(len(self.points.slip)))

    @property
    def observed(self) -> np.ndarray:
        """The factors (points, 1, 1)."""
        return np.asarray(self.points.factor)[:, None, None]

    @property
    def varied(self) -> np.ndarray:
        """The slips."""
        return np.asarray(self.points.slip)[:, None, None]

    def noise(self) -> Noise:
        """Return white noise of each point's SD."""
        return declared_noise(np.asarray(self.points.sd)[:, None, None], self.observed)

    @cached_property
    def _shifts(self) -> dict[str, Shift]:
        """What moves the factors of all points together, by name."""
        shared = [Shift(_shared_error("common_factor"), self.points.shared)] if np.any(self.points.shared) else []
        return {shift.parameter.name: shift for shift in (*shared, *self.shifts)}

    def base_model(self) -> Parts:
        """Return the soil and the wheel as declared, and no errors."""
        slips = slip_errors(len(self.points.slip))
        return Parts({**self.declared.records, "points": PointErrors(), "slips": slips})

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return k and phi, of which nothing is known, the other constants that enter, and what the points share."""
        constants = [
            unknown_constant(owner, model.records[owner], name)
            if name in SOUGHT
            else known_constant(owner, model.records[owner], name, self.points.declared, self.points.doubts)
            for owner in ("wheel", "soil")
            for name in quantities(model.records[owner])
            if name != MODULUS_BY_WIDTH
        ]
        slopes = self.sensitivities(model, constants, np.zeros(len(constants))).slopes
        moved = np.abs(self.noise().white(slopes)).max(axis=1)
        entering = [number for number, size in zip(constants, moved, strict=True) if size > ENTERS]
        slips = [
            Parameter(f"slips.point_{at + 1}", 0.0, 1.0, -10.0, 10.0, declared=True, source="the SD of its slip")
            for at in np.flatnonzero(self.points.slip_sd)
        ]
        slips += [_shared_error("common_slip")] if np.any(self.points.slip_shared) else []
        return (*entering, *(shift.parameter for shift in self._shifts.values()), *slips)

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return nothing: one curve of F over S shows no effect."""
        return ()

    def sensitivities(self, model: Parts, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the factors, and their exact slopes."""
        values = {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
        model = self.with_values(model, values)
        constants: dict[str, Any] = {**model.records["wheel"].values(), **model.records["soil"].values()}
        free = tuple(name for name in values if name.partition(".")[0] in ("wheel", "soil"))
        errors = np.array([*model.records["slips"].values().values()])
        shared = self.points.slip_shared * model.records["points"].common_slip
        slip = self.points.slip + self.points.slip_sd * errors + shared
        names, points = tuple(name.partition(".")[2] for name in free), self.points
        kind: tuple[Any, Any, bool] = (points.form, points.angles, bool(points.loads.size))
        law = factor_law(*kind, names, len(slip))
        conditions = np.array([slip, points.loads if points.loads.size else np.zeros(len(slip))])
        factors, rises, *jacobian = law(conditions, np.array([float(constants[name]) for name in FIELDS])).full()
        slopes = dict(zip(free, jacobian, strict=True))
        for name, shift in self._shifts.items():
            factors = factors + shift.effect * shift.parameter.u(self.value(model, name))
            slopes[name] = shift.effect / shift.parameter.scale
        slopes["points.common_slip"] = rises * self.points.slip_shared
        for at, reach in enumerate(rises * self.points.slip_sd):
            slopes[f"slips.point_{at + 1}"] = np.where(np.arange(len(slip)) == at, reach, 0.0)
        columns = [slopes[parameter.name] * parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)]
        return Sensitivities(factors[:, None, None], np.array(columns).reshape(len(columns), len(factors), 1, 1))

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the factors of each model (models, points, 1, 1)."""
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])


def _shared_error(name: str) -> Parameter:
    """Return one of `PointErrors`, of which nothing but its SD is known."""
    return parameter_of(f"points.{name}", PointErrors(), 1.0)
