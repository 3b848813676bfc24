"""Model of a wheel on a test rig: wheel, soil and effects predict the rig's readings at a given load and slip.

`RigModel` is the model of one data set. `predictor` is its compiled form, with derivatives by chosen parameters.
"""

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
from rover_pin.measurements.channel import RigErrors
from rover_pin.simulation.model.effect_files import effect_entry, effect_from
from rover_pin.simulation.model.toml_file import RIG_KIND
from rover_pin.soil.angles import SHALLOW, SinkageAngles
from rover_pin.soil.slip import rim_and_travel
from rover_pin.soil.wheel_forces import NetTraction

PAPER: tuple[Effect, ...] = (SoilTraction(NetTraction(), SinkageAngles()),)
"""Effects of the base model for a wheel that rolls straight ahead: stresses, shear and forces by Eqs (2)-(7) of the
paper, with contact angles that follow from the sinkage."""

ASKEW: tuple[Effect, ...] = (*PAPER, CombinedShear(1.0, NetTraction(), SinkageAngles()))
"""Effects of the base model for a wheel with a slip angle. Such a wheel shears the soil along and across its
heading."""

MAX_STEPS = 40
"""Maximum number of Newton steps for the sinkage. A run that has not converged after them counts as not predicted. A
poor initial guess needs many steps, because half of them only halve the bracket."""

STEP_TOLERANCE = 1e-8
"""Newton's method ends if its last step in ln y and in the states of effects is smaller than this value. Here y is the
sinkage below the soil surface that the effects leave. The error that remains is of the order of the square of this
step."""

LOAD_TOLERANCE = 1e-6
"""Maximum relative difference between the carried load and the given load. With a larger difference, the run counts as
not predicted."""


class Steady(NamedTuple):
    """Predicted readings of a rig in steady runs, one array (runs,) for each channel."""

    drawbar_pull: np.ndarray
    "horizontal force along the heading [N]"
    torque: np.ndarray
    "torque at the axle [N m]"
    sinkage: np.ndarray
    "sinkage of the wheel's lowest point below the free surface [m]"
    side_force: np.ndarray
    "force along the axle, positive if it resists the sideways motion at a positive slip angle [N]"
    moment: np.ndarray
    "moment about the vertical through the wheel's centre, positive if it turns the wheel to its left [N m]"
    motor_torque: np.ndarray
    "torque at the axle as computed from the current of the motor [N m]"


@brief
@dataclass(frozen=True)
class RigModel:
    """Model of one wheel on a test rig: the wheel, the soil under it, and the effects that act on the wheel.

    The effects act one after another in the given order, as in the simulation of a drive. Every contact effect can be
    used. On a rig, the approach speed is 0, the wheel is the first one that passes over the soil, and the states of the
    effects have their steady values. At a positive slip angle the wheel moves to its right: its sideways speed v_y is
    negative and the side force f_y is positive.

    Parameters
    ----------
    wheel, soil : Wheel and Soil
        Sizes of the wheel [m] and constants of the soil [SI].
    effects : tuple of Effect
        Effects, each class at most once.
    errors : RigErrors
        Offsets and scales of the rig's readings.

    Raises
    ------
    ParameterError
        Two effects have one class.

    Examples
    --------
    >>> model = RigModel(Wheel(0.06, 0.05), Soil())
    >>> round(float(model.predict(30.0, 0.3).sinkage[0]), 3)
    0.016
    """

    wheel: Wheel
    soil: Soil
    effects: tuple[Effect, ...] = PAPER
    errors: RigErrors = RigErrors()

    def __post_init__(self) -> None:
        kinds = [type(effect).__name__ for effect in self.effects]
        for kind in kinds:
            if kinds.count(kind) > 1:
                raise ParameterError(
                    f"the model has the effect {kind} twice, but a rig model can have each effect only once; remove "
                    "one."
                )

    def having(self, effect: Effect) -> RigModel:
        """Return the model with one more effect, which acts after the effects that the model already has."""
        return dataclasses.replace(self, effects=(*self.effects, effect))

    @property
    def records(self) -> dict[str, Any]:
        """Mapping from names to the parts of the model that have numbers to fit.

        The names are "wheel", "soil", "rig" for the reading errors, and the class name of each effect.
        """
        effects_by_name = {type(effect).__name__: effect for effect in self.effects}
        return {"wheel": self.wheel, "soil": self.soil, "rig": self.errors, **effects_by_name}

    def with_record(self, owner: str, record: Any) -> RigModel:
        """Return the model with another part: `record` replaces the part named `owner`, which is a key of `records`.

        The keys are "wheel", "soil", "rig" for the reading errors, and the class names of the effects.
        """
        if owner in ("wheel", "soil", "rig"):
            return dataclasses.replace(self, **{owner.replace("rig", "errors"): record})
        effects = tuple(record if type(effect).__name__ == owner else effect for effect in self.effects)
        return dataclasses.replace(self, effects=effects)

    def of(self, name: str) -> RigModel:
        """Return the model of the data set `name`, which is this model itself, because a `RigModel` describes one data
        set only.

        The method exists because a `JointModel`, which describes several data sets, has it too.
        """
        return self

    def share(self, name: str, parameter: str) -> float:
        """Return the ratio of a parameter of the data set `name` to this parameter of the model.

        The ratio is always 1, because a `RigModel` describes one data set only.
        """
        return 1.0

    @cached_property
    def structure(self) -> tuple[Effect, ...]:
        """The effects with default numbers. Compiled functions of the model are stored under this key.

        Options of an effect that are not numbers keep their values.
        """

        def with_defaults(effect: Effect) -> Effect:
            fields = {field.name: field.default for field in dataclasses.fields(effect)}
            return effect.replace(**{name: fields[name] for name in quantities(effect)})

        return tuple(map(with_defaults, self.effects))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters of the model.

        The constants of wheel and soil come first, then "Effect.parameter" for each effect, then "rig.error" for each
        reading error.
        """
        return parameter_names(self.effects)

    def vector(self) -> np.ndarray:
        """Return the values of all parameters, in the order of `names`."""
        records = (self.wheel, self.soil, *self.effects, self.errors)
        return np.array([float(value) for record in records for value in record.values().values()])

    def predict(self, load: Any, slip: Any, speeds: Any = None, slip_angle: Any = 0.0) -> Steady:
        """Return the readings of the rig that the model predicts in steady runs.

        Newton's method finds the sinkage at which the normal force f_n of all effects balances the load.

        Parameters
        ----------
        load, slip : float or array [runs]
            Load [N], and slip ratio [-] by Eq (1) of the paper, (r omega - v) / max(r omega, v).
        speeds : array [runs, 2], optional
            Travel speed and rim speed [m/s]. By default, the faster of the two is 0.05 m/s.
        slip_angle : float or array [runs]
            Angle between heading and travel [rad], up to 90 deg. At 90 deg the speeds must be given.

        Raises
        ------
        DataError
            No sinkage down to the axle carries the load of a run.
        """
        load, slip = np.broadcast_arrays(np.atleast_1d(np.asarray(load, float)), np.asarray(slip, float))
        values = predictor(self, (), conditions(load, slip, speeds, slip_angle))(self.vector()).values
        if np.isnan(values).any():
            raise DataError(
                f"{uncarried_runs(values, load, slip)} with this model; lighten the wheel or choose a firmer soil."
            )
        return Steady(*values)


def uncarried_runs(values: np.ndarray, load: np.ndarray, slip: np.ndarray) -> str:
    """Return a clause on the runs without a prediction; an empty text if every run has a prediction.

    A run has no prediction if no sinkage down to the axle carries its load. `values` (6, runs) holds the predicted
    channels, which are NaN in such a run. The clause states the load [N] and the slip [-] of the first such run.
    """
    # The first such run is named and the others are counted.
    lost = np.flatnonzero(np.isnan(values).any(axis=0))
    if not lost.size:
        return ""
    also = f" (and so for {lost.size - 1} other of {load.size} runs)" if lost.size > 1 else ""
    first = lost[0]
    return f"no sinkage down to the axle carries load = {load[first]:g} N at slip = {slip[first]:g}{also}"


NOMINAL = 0.05
"""Speed that is assumed for runs without measured speeds [m/s]: the rim speed or the travel speed, whichever is
faster."""


def conditions(
    load: np.ndarray, slip: np.ndarray, speeds: np.ndarray | None = None, slip_angle: Any = 0.0
) -> np.ndarray:
    """Return the inputs of steady runs for the compiled functions, as an array (runs, 5).

    The five columns are the load [N], the slip [-], the travel speed along the heading, the rim speed, and the speed
    along the axle [m/s]. `speeds` (runs, 2) holds travel speed and rim speed. If `speeds` is None, both speeds are
    computed from the slip by Eq (1) of the paper (the definition of the slip ratio), and the faster one is 0.05 m/s.
    `slip_angle` is the angle between heading and travel [rad].
    """
    if speeds is None:
        speeds = NOMINAL * np.column_stack(rim_and_travel(slip)[::-1])
    along = np.asarray(speeds)[:, 0]
    return np.column_stack([load, slip, speeds, along * -np.tan(slip_angle)])


class RigPrediction(NamedTuple):
    """Predicted channels of a rig, and their derivatives by the free parameters.

    All values of a run are NaN if no sinkage down to the axle carries the load of the run.
    """

    values: np.ndarray
    "channels (6, runs) in SI, in the order of `Steady`"
    jacobian: np.ndarray
    "derivatives of the channels by the free parameters (6, runs, free)"
    error: np.ndarray
    """natural logarithm of (carried load / given load) (runs,); 0 if the sinkage is exact"""


class RigPredictor:
    """Compiled function that predicts the channels of fixed runs from the values of all parameters of a model.

    `predictor` makes such a function. Compilation takes long, so one `RigPredictor` is used for many evaluations.
    """

    def __init__(self, law: Law, runs: np.ndarray, repeats: np.ndarray, free: int):
        self._law, self._runs, self._repeats, self._free = law, ca.DM(runs.T), repeats, free

    def __call__(self, vector: np.ndarray) -> RigPrediction:
        """Return the predicted channels for the given values of all parameters, in the order of `RigModel.names`."""
        p = ca.DM(vector)
        # Solve for the unknowns z (unknowns, runs) at which each wheel carries its load, by a bracketed Newton method.
        # The first unknown of a run is ln y, where y is the sinkage below the soil surface that the effects leave. The
        # other unknowns are states of effects. For each run, ln y lies in a bracket between a sinkage that is too small
        # and a sinkage that is too large. If a Newton step leaves the bracket, the middle of the bracket is taken
        # instead. A sinkage also counts as too small if the soil pulls the wheel down, as cohesion may do under a
        # braked wheel, because the logarithm of the normal force is then undefined. The initial guess is the sinkage of
        # a power law. The bracket extends from a nearly flat contact to the axle.
        z, r = self._law.first(self._runs, p).full(), float(p[FIELDS.index("r")])
        low, high = np.full((2, z.shape[1]), np.log([[2 * SHALLOW * r], [r]]))
        for step in range(MAX_STEPS):
            before, (after, off) = z, (matrix.full() for matrix in self._law.newton(z, self._runs, p))
            deep = off[0] > 0.0
            low, high = np.where(deep, low, z[0]), np.where(deep, z[0], high)
            converged = np.abs(after[0] - z[0]) <= STEP_TOLERANCE
            # In the second half of the steps, every other step halves the bracket, which ensures convergence.
            newton = step < MAX_STEPS // 2 or step % 2 == 0
            is_accepted = np.isfinite(after).all(axis=0) & (converged | newton & (after[0] > low) & (after[0] < high))
            z = np.where(is_accepted, after, np.vstack([(low + high) / 2, z[1:]]))
            if not np.abs(z - before).max() > STEP_TOLERANCE:
                break
        # Repeated runs were computed once and are spread here.
        out = self._law.point(z, self._runs, p).full()[:, self._repeats]
        error, lost = out[VALUES].copy(), ~(np.abs(out[VALUES]) < LOAD_TOLERANCE)
        out[:, lost] = np.nan
        jacobian = out[VALUES + 1 :].reshape(self._free, VALUES, self._repeats.size).transpose(1, 2, 0)
        return RigPrediction(out[:VALUES], jacobian, error)


def predictor(model: RigModel, free: Sequence[str], runs: np.ndarray) -> RigPredictor:
    """Compile the function from all parameters of a model to the channels at given runs, and return it.

    Parameters
    ----------
    model : RigModel
        Model whose effects and options are compiled. The values of its parameters do not matter.
    free : sequence of str
        Names of the parameters for the derivatives of the channels.
    runs : array (runs, 5)
        Inputs of the runs, as `conditions` returns them.
    """
    # Runs with equal inputs have the same prediction, which is computed once.
    different, repeats = np.unique(runs, axis=0, return_inverse=True)
    law = steady_law(model.structure, tuple(free), len(different))
    return RigPredictor(law, different, repeats.ravel(), len(free))


def write_model(model: RigModel, path: str | Path, note: str = "") -> Path:
    """Write the model to a TOML file and return its path; `note` is a remark for the reader of the file.

    An effect from outside the package is written with the path of its Python file.

    Examples
    --------
    >>> import tempfile
    >>> model = RigModel(Wheel(), Soil())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_model(write_model(model, f"{folder}/model.toml")) == model
    True
    """
    # Reading errors are written only if at least one of them differs from none.
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
    """Read the model of a wheel on a rig from a TOML file. The code of a user's effect runs only if `trust` allows it.

    Raises
    ------
    DataError
        The file is not a model of a wheel on a rig; or an effect in it is unknown or does not act at a contact; or the
        file with the code of an effect is not trusted or cannot be run.
    ParameterError
        A field or unit is unknown, or a value is out of bounds.
    """
    # Paths of effect files in the model are relative to the folder of the model file.
    path = Path(path)
    table = read_toml(path)
    entries = tables_in(table, "effect", path)
    if table.get("kind") != RIG_KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a rig model; write kind = '{RIG_KIND}'.")
    # Effects of the body or of sensors exist too, but only contact effects act on a wheel alone.
    effects = []
    for entry in entries:
        effect = effect_from(entry, f"{path} [[effect]]", path.parent, trust)
        if not isinstance(effect, Effect):
            raise DataError(
                f"{path}: {entry['name']} does not act at the wheel's contact, so a model of a rig cannot have it."
            )
        effects.append(effect)
    return RigModel(
        record_from(Wheel, table.get("wheel", {}), f"{path} [wheel]"),
        record_from(Soil, table.get("soil", {}), f"{path} [soil]"),
        tuple(effects),
        record_from(RigErrors, table.get("rig", {}), f"{path} [rig]"),
    )
