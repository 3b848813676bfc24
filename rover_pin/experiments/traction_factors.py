"""An experiment with traction factors F (traction divided by wheel load, Fig 6 of the paper) at several slips S.

The points come from a CSV file or from a drive log.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import casadi as ca
import numpy as np

from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.experiment import FileExperiment, Parts
from rover_pin.estimation.experiment import Differentiable, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter, parameter_of
from rover_pin.experiments.soil_priors import known_constant, unknown_constant
from rover_pin.experiments.wheel_rig.steady_law import FIELDS, with_values_of
from rover_pin.measurements.traction_points import TractionPoints, read_traction_points
from rover_pin.parameters import TABLE_1
from rover_pin.soil.sinkage import fitted_entry_angle
from rover_pin.soil.wheel_forces import load_traction_factor

FREE_CONSTANTS = ("k", "phi")
"""Soil constants without a prior, because a curve of traction factor against slip is measured to find them."""
MODULUS_BY_WIDTH = "k_2"
"""Soil constant that is never fitted. Data of one wheel with the width b determine only the sum k_1 + k_2 b, so k_1
alone is fitted."""
MIN_EFFECT = 1e-9
"""Minimum influence of a constant that is fitted. The influence is the largest change of a point, as a multiple of the
point's SD, if the constant changes by its prior SD. A constant with less influence is not fitted."""


@lru_cache(maxsize=64)
def factor_law(form: Any, angles: Any, loaded: bool, free: tuple[str, ...], points: int) -> ca.Function:
    """Return a CasADi function that computes the traction factor F at several points, and the derivatives of F.

    The arguments of the CasADi function are the slip S and the wheel load W of each point (2, points), and all
    constants of wheel and soil. The function returns F, dF/dS, and the derivative of F by each constant in `free`, as
    rows (2 + number of constants in `free`, points). If `loaded` is True, the contact arc begins at the entry angle at
    which the wheel carries the load of the point. Otherwise it begins at the angle theta_1 of the soil.
    """
    # The slip is a symbol of its own until dF/dS is formed, and is then replaced by the first input.
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
    """Errors that all points of a traction curve have in common. Each error is stated as a multiple of its SD."""

    common_factor: Scalar = quantity(0.0, "", "assumed: loads and the torque constant are wrong together", -10, 10)
    common_slip: Scalar = quantity(0.0, "", "assumed: rates and radii are wrong together", -10.0, 10.0)


@lru_cache(maxsize=16)
def slip_errors(count: int) -> Any:
    """Return a record with one number for each of `count` points: the error of the point's slip, as a multiple of its
    SD.
    """
    errors = [
        (f"point_{at + 1}", float, quantity(0.0, "", "declared: the SD of its slip", -10, 10)) for at in range(count)
    ]
    return make_dataclass("SlipErrors", errors, bases=(Record,), frozen=True)()


class Shift(NamedTuple):
    """A number that enters all traction factors, such as a motor constant, and its influence on them.

    `effect` is the derivative of each traction factor by the fit coordinate u (points,), where u is the deviation of
    the number from its prior mean in units of its prior SD. If the number is wrong, all points are wrong together.
    """

    parameter: Parameter
    effect: np.ndarray


@dataclass(frozen=True, eq=False)
class TractionFactors(FileExperiment, Differentiable):
    """Measured traction factors at several slips, as an experiment for the fit of soil constants.

    `points` holds the traction factors with their SDs, and `declared` is the declared model of soil and wheel. The true
    slip of a point is S + a xi, where S is the measured slip, a its SD, and xi ~ N(0, 1) is fitted. If noisy slips were
    taken as exact, they would flatten the fitted curve (regression dilution). The errors of slip and traction factor
    that all points have in common are fitted too. `shifts` holds further numbers to fit, for example motor constants.

    Source: Deming, Statistical Adjustment of Data (1943); York et al., American Journal of Physics 72 (2004) 367.
    """

    points: TractionPoints
    declared: Parts = field(repr=False)
    shifts: tuple[Shift, ...] = field(default=(), repr=False)
    name: str = "traction factors"
    channels = ("traction factor",)
    is_for_loop: ClassVar[bool] = False

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the experiment from a CSV file of traction factors. The soil is the sand of Table 1 of the paper."""
        points = read_traction_points(path)
        return cls(points, Parts({"soil": TABLE_1, "wheel": points.wheel}), name=path.stem)

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the groups that are held out of a fit together. Each point is a group of its own."""
        return tuple(f"point {number + 1}" for number in range(len(self.points.slip)))

    @property
    def observed(self) -> np.ndarray:
        """Measured traction factors (points, 1, 1)."""
        return np.asarray(self.points.factor)[:, None, None]

    @property
    def varied(self) -> np.ndarray:
        """Input of each point (points, 1, 1): its slip."""
        return np.asarray(self.points.slip)[:, None, None]

    def noise(self) -> Noise:
        """Return the noise model of the traction factors: independent noise with the declared SD of each point."""
        return declared_noise(np.asarray(self.points.sd)[:, None, None], self.observed)

    @cached_property
    def _shifts(self) -> dict[str, Shift]:
        """The numbers whose errors change all traction factors together, by their names."""
        # Without a shared error, the number would have no influence and only its prior.
        shared = [Shift(_shared_error("common_factor"), self.points.shared)] if np.any(self.points.shared) else []
        return {shift.parameter.name: shift for shift in (*shared, *self.shifts)}

    def base_model(self) -> Parts:
        """Return the declared soil and wheel, with errors of slips and traction factors that are all 0."""
        slips = slip_errors(len(self.points.slip))
        return Parts({**self.declared.records, "points": PointErrors(), "slips": slips})

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return the numbers to fit: soil and wheel constants that influence the points, and errors of the points.

        k and phi have no priors, and all other numbers have one.
        """
        constants = [
            unknown_constant(owner, model.records[owner], name)
            if name in FREE_CONSTANTS
            else known_constant(owner, model.records[owner], name, self.points.declared, self.points.doubts)
            for owner in ("wheel", "soil")
            for name in quantities(model.records[owner])
            if name != MODULUS_BY_WIDTH
        ]
        # Constants that no point depends on would only add their priors.
        slopes = self.sensitivities(model, constants, np.zeros(len(constants))).slopes
        moved = np.abs(self.noise().white(slopes)).max(axis=1)
        entering = [number for number, size in zip(constants, moved, strict=True) if size > MIN_EFFECT]
        # Points with an exact slip (SD 0) need no number for its error.
        slips = [
            Parameter(f"slips.point_{at + 1}", 0.0, 1.0, -10.0, 10.0, declared=True, source="the SD of its slip")
            for at in np.flatnonzero(self.points.slip_sd)
        ]
        slips += [_shared_error("common_slip")] if np.any(self.points.slip_shared) else []
        return (*entering, *(shift.parameter for shift in self._shifts.values()), *slips)

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return no candidates for a missing effect, because one curve of traction factor against slip cannot
        distinguish effects.
        """
        return ()

    def sensitivities(self, model: Parts, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the predicted traction factors and their exact derivatives by the parameters, at the fit coordinates
        `u`.
        """
        # The true slip of a point is its measured slip plus its own error and the error that all points have in common.
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
        # Shared errors act linearly on the factors, and errors of the slips through dF/dS.
        for name, shift in self._shifts.items():
            factors = factors + shift.effect * shift.parameter.u(self.value(model, name))
            slopes[name] = shift.effect / shift.parameter.scale
        slopes["points.common_slip"] = rises * self.points.slip_shared
        for at, reach in enumerate(rises * self.points.slip_sd):
            slopes[f"slips.point_{at + 1}"] = np.where(np.arange(len(slip)) == at, reach, 0.0)
        # The fit uses coordinates u, so each derivative is multiplied by d value / du (chain rule).
        columns = [slopes[parameter.name] * parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)]
        return Sensitivities(factors[:, None, None], np.array(columns).reshape(len(columns), len(factors), 1, 1))

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the traction factors that each model predicts (models, points, 1, 1)."""
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])


def _shared_error(name: str) -> Parameter:
    """Return one number of `PointErrors`, for example "common_slip", as a parameter in units of its SD."""
    return parameter_of(f"points.{name}", PointErrors(), 1.0)
