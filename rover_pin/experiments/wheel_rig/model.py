"""A wheel on a rig as a model: wheel, soil and a tuple of effects that carry a given load at a given slip."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.toml_file import read_toml, tables_in, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.public import brief
from rover_pin.base.quantity import as_table, quantities, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.wheel_rig.steady_law import FIELDS, VALUES, Law, parameter_names, steady_law
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.simulation.model.effect_files import effect_entry, effect_from
from rover_pin.simulation.model.toml_file import RIG_KIND
from rover_pin.soil.angles import SHALLOW, SinkageAngles
from rover_pin.soil.slip import rim_and_travel
from rover_pin.soil.wheel_forces import NetTraction

PAPER: tuple[Effect, ...] = (SoilTraction(NetTraction(), SinkageAngles()),)
"""Eqs (2)-(7), the arc from the sinkage: what a rig measures before anything is added."""

ASKEW: tuple[Effect, ...] = (*PAPER, CombinedShear(1.0, NetTraction(), SinkageAngles()))
"""The same with its shear along and across: what a wheel at a slip angle starts from."""

STEPS = 40
"""Newton steps on ln y, at most; the base model needs 3, an effect that changes the exponent 6, steep starts more."""

SETTLED = 1e-8
"""Newton's last step in ln y and the states: the error after it is of its square."""

UNBALANCED = 1e-6
"""Relative error of the carried load from which a prediction is refused."""


class Steady(NamedTuple):
    """What a rig shows at each run: arrays [runs]."""

    drawbar_pull: np.ndarray
    "f_t [N]"
    torque: np.ndarray
    "[N m]"
    sinkage: np.ndarray
    "[m]"
    side_force: np.ndarray
    "along the axle, positive where the soil resists the sideways motion of a positive slip angle [N]"
    moment: np.ndarray
    "about the vertical through the wheel's centre, positive turning it to its left [N m]"


@brief
@dataclass(frozen=True)
class RigModel:
    """A wheel, the soil under it and the effects that push on it; `effects` act in order, as in a drive.

    Every effect that acts at a contact works here: the approach speed is 0, the wheel is the first that passes, own
    states are at their steady values. At a slip angle the wheel goes to its right: v_y < 0 < f_y.
    """

    wheel: Wheel
    soil: Soil
    effects: tuple[Effect, ...] = PAPER
    errors: RigErrors = RigErrors()
    "what the rig adds to its readings"

    def __post_init__(self) -> None:
        kinds = [type(effect).__name__ for effect in self.effects]
        for kind in kinds:
            if kinds.count(kind) > 1:
                raise ParameterError(f"the model has the effect {kind} twice; a rig model holds each kind once.")

    def having(self, effect: Effect) -> RigModel:
        """Return the model with one more effect."""
        return dataclasses.replace(self, effects=(*self.effects, effect))

    @property
    def records(self) -> dict[str, Any]:
        """Wheel, soil, the rig's errors and effects by name."""
        effects_by_name = {type(effect).__name__: effect for effect in self.effects}
        return {"wheel": self.wheel, "soil": self.soil, "rig": self.errors, **effects_by_name}

    def with_record(self, owner: str, record: Any) -> RigModel:
        """Return the model with another wheel, soil or effect in the place of the one of this name."""
        if owner in ("wheel", "soil", "rig"):
            return dataclasses.replace(self, **{owner.replace("rig", "errors"): record})
        effects = tuple(record if type(effect).__name__ == owner else effect for effect in self.effects)
        return dataclasses.replace(self, effects=effects)

    def of(self, name: str) -> RigModel:
        """Return the model of a set, the only one there is."""
        return self

    def lug_share(self, name: str) -> float:
        """Return the height of a set's lugs over that of the highest."""
        return 1.0

    @cached_property
    def structure(self) -> tuple[Effect, ...]:
        """The effects with default numbers: what the compiled law depends on."""
        return tuple(_skeleton(effect) for effect in self.effects)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters: those of wheel and soil, `Effect.parameter`, `rig.error`."""
        return parameter_names(self.effects)

    def vector(self) -> np.ndarray:
        """Return the values of all parameters, in the order of `names`."""
        records = (self.wheel, self.soil, *self.effects, self.errors)
        return np.array([float(value) for record in records for value in record.values().values()])

    def predict(self, load: Any, slip: Any, speeds: Any = None, slip_angle: Any = 0.0) -> Steady:
        """Return the channels as the rig reads them: loads [N], slips [-], speeds of travel and rim [runs, 2] [m/s].

        `slip_angle` [rad] is that between heading and travel, to 90 deg (there with speeds). f_n of the chained effects
        is balanced with the load by Newton's method on ln h; without `speeds` the faster of the two is 0.05 m/s.

        Raises DataError: a run whose load no sinkage down to the axle carries.
        """
        load, slip = np.broadcast_arrays(np.atleast_1d(np.asarray(load, float)), np.asarray(slip, float))
        values = predictor(self, (), conditions(load, slip, speeds, slip_angle))(self.vector()).values
        if np.isnan(values).any():
            raise DataError(f"{uncarried_runs(values, load, slip)} with this model; {FIRMER}.")
        return Steady(*values)


FIRMER = "lighten the wheel or choose a firmer soil"


def uncarried_runs(values: np.ndarray, load: np.ndarray, slip: np.ndarray) -> str:
    """Return which runs are not predicted, and why, in words; empty where every channel [5, runs] is."""
    lost = np.flatnonzero(np.isnan(values).any(axis=0))
    if not lost.size:
        return ""
    also = f" (nor {lost.size - 1} other of {load.size} runs)" if lost.size > 1 else ""
    first = lost[0]
    return f"no sinkage down to the axle carries load = {load[first]:g} N at slip = {slip[first]:g}{also}"


NOMINAL = 0.05
"""The faster of rim and travel speed where none is stated [m/s]."""


def conditions(
    load: np.ndarray, slip: np.ndarray, speeds: np.ndarray | None = None, slip_angle: Any = 0.0
) -> np.ndarray:
    """Return the inputs of steady runs [runs, 5]; speeds follow from Eq (1) where they are not given."""
    if speeds is None:
        speeds = NOMINAL * np.column_stack(rim_and_travel(slip)[::-1])
    along = np.asarray(speeds)[:, 0]
    return np.column_stack([load, slip, speeds, along * -np.tan(slip_angle)])


class Predicted(NamedTuple):
    """Channels [5, runs], their derivatives [5, runs, free], and the relative error of the carried load [runs].

    Channels and derivatives of a run that no sinkage down to the axle carries are NaN: it is not predicted.
    """

    values: np.ndarray
    jacobian: np.ndarray
    error: np.ndarray


class RigPredictor:
    """The channels of a model structure at given runs, as a function of all its parameters."""

    def __init__(self, law: Law, runs: np.ndarray, repeats: np.ndarray, free: int):
        self._law, self._runs, self._repeats, self._free = law, ca.DM(runs.T), repeats, free

    def __call__(self, vector: np.ndarray) -> Predicted:
        """Return the prediction at these values of all parameters."""
        p = ca.DM(vector)
        out = self._law.point(self._balance_runs(p), self._runs, p).full()[:, self._repeats]
        error, lost = out[VALUES].copy(), ~(np.abs(out[VALUES]) < UNBALANCED)
        out[:, lost] = np.nan
        jacobian = out[VALUES + 1 :].reshape(self._free, VALUES, self._repeats.size).transpose(1, 2, 0)
        return Predicted(out[:VALUES], jacobian, error)

    def _balance_runs(self, p: ca.DM) -> np.ndarray:
        """Return z of every run after Newton's steps, as many as the slowest run needs.

        Where a step leaves what is left between too shallow and too deep, y goes to the middle of that: too shallow is
        also where the ground pulls the wheel down, as cohesion does under a braked one, and ln f_n tells no step.
        """
        z, r = self._law.first(self._runs, p).full(), float(p[FIELDS.index("r")])
        low, high = np.full((2, z.shape[1]), np.log([[2 * SHALLOW * r], [r]]))
        for step in range(STEPS):
            before, (after, off) = z, (matrix.full() for matrix in self._law.newton(z, self._runs, p))
            deep = off[0] > 0.0
            low, high = np.where(deep, low, z[0]), np.where(deep, z[0], high)
            converged = np.abs(after[0] - z[0]) <= SETTLED
            newton = step < STEPS // 2 or step % 2 == 0  # from half-way every other step halves what is left
            is_accepted = np.isfinite(after).all(axis=0) & (converged | newton & (after[0] > low) & (after[0] < high))
            z = np.where(is_accepted, after, np.vstack([(low + high) / 2, z[1:]]))
            if not np.abs(z - before).max() > SETTLED:
                break
        return np.asarray(z)


def predictor(model: RigModel, free: Sequence[str], runs: np.ndarray) -> RigPredictor:
    """Return the predictor of a model's structure at `runs` [runs, 5], with derivatives by the `free` parameters."""
    different, repeats = np.unique(runs, axis=0, return_inverse=True)
    law = steady_law(model.structure, tuple(free), len(different))
    return RigPredictor(law, different, repeats.ravel(), len(free))


def _skeleton(effect: Effect) -> Effect:
    """Return the effect with default numbers: what its compiled law depends on."""
    fields = {field.name: field.default for field in dataclasses.fields(effect)}
    return effect.replace(**{name: fields[name] for name in quantities(effect)})


def write_model(model: RigModel, path: str | Path, note: str = "") -> Path:
    """Write the model; an effect from outside the package keeps the path of its file."""
    table = {
        "kind": RIG_KIND,
        "note": note,
        "wheel": as_table(model.wheel),
        "soil": as_table(model.soil),
        **({"rig": as_table(model.errors)} if model.errors != RigErrors() else {}),
        "effect": [effect_entry(effect) for effect in model.effects],
    }
    return replace_file(path, toml_text(table))


def read_model(path: str | Path, trust: Trust = Trust()) -> RigModel:
    """Return the model of a file; the code of a user's effect runs only if `trust` allows it.

    Raises DataError: not a model file, an effect that is not known, or the file of one that is not trusted or cannot be
    run.
    Raises ParameterError: an unknown field, unit or value.
    """
    path = Path(path)
    table = read_toml(path)
    effects = tables_in(table, "effect", path)
    if table.get("kind") != RIG_KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a rig model; write kind = '{RIG_KIND}'.")
    return RigModel(
        record_from(Wheel, table.get("wheel", {}), f"{path} [wheel]"),
        record_from(Soil, table.get("soil", {}), f"{path} [soil]"),
        tuple(_effect(entry, path, trust) for entry in effects),
        record_from(RigErrors, table.get("rig", {}), f"{path} [rig]"),
    )


def _effect(entry: dict[str, Any], path: Path, trust: Trust) -> Effect:
    effect = effect_from(entry, f"{path} [[effect]]", path.parent, trust)
    if not isinstance(effect, Effect):
        raise DataError(f"{path}: {entry['name']} does not act at the wheel's contact: a rig has no place for it.")
    return effect
