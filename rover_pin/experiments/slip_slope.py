"""An experiment with slip against slope of a whole rover, as in most publications: each point is a steady drive on a
slope.

DATA is a folder with slope.toml and points.csv. Example of slope.toml::

    kind = "slip-slope"
    name = "our rover on dry sand"
    rover = "rover.toml" # a name, or a TOML next to it gravity = 9.81 [soil] # known constants: { value, unit, sd } phi
    = { value = 34.0, unit = "deg", sd = 2.0 }

points.csv has the columns run, slope_deg, slip and slip_sd. All points of a run are held out of a fit together.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from rover_pin.base.encode import printable
from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import declared_sd, declared_sds, record_from
from rover_pin.contact import Soil
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.experiment import FileExperiment, Parts
from rover_pin.effects.effect import Effect
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.parameter import Parameter, declared_in
from rover_pin.experiments.folded import read_folded
from rover_pin.experiments.soil_priors import SD
from rover_pin.experiments.wheel_rig.model import RigModel, conditions, predictor
from rover_pin.parameters.gravity import EARTH, gravity_from
from rover_pin.rover.rover import Rover, load_named
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.model.defaults import own_soil, usual_angles
from rover_pin.simulation.model.effect_files import reading_traction
from rover_pin.simulation.model.model import base_effects
from rover_pin.soil.wheel_forces import TorqueTraction

FILE, KIND = "slope.toml", "slip-slope"
KEYS = ("kind", "name", "source", "rover", "gravity", "soil")
COLUMNS = ("slope_deg", "slip", "slip_sd")
SLIPS = np.concatenate([np.linspace(-0.5, 0.0, 11)[:-1], np.linspace(0.0, 0.98, 50)])
"""Slips at which the pull of a wheel is computed. Between two of them, the pull is interpolated linearly."""
STUCK = 1.0
"""Slip that is predicted on a slope that the rover cannot climb, because no slip gives the required pull."""
R_SD = 0.15
"""Prior SD of the coefficient R of the motion resistance [-] (assumed)."""
MIN_SLOPES = 4
"""Minimum number of different slopes. With fewer slopes, the search for missing effects gives no answer. Why: three
numbers are uncertain."""


@dataclass(frozen=True, eq=False)
class SlipSlope(FileExperiment):
    """Slip against slope of a whole rover, as an experiment for the fit of soil and motion resistance.

    `slopes` holds the slopes [rad] (folds, samples), `observed` the slips on these slopes (folds, 1, samples), and `sd`
    the SD of a slip (1,).
    """

    rover: Rover
    soil: Soil
    gravity: float
    folds: tuple[str, ...]
    slopes: np.ndarray
    observed: np.ndarray
    sd: np.ndarray
    declared: Mapping[str, Any] = field(default_factory=dict)
    name: str = "slip against slope"
    channels = ("slip",)
    file: ClassVar[str] = FILE

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the experiment from a folder with slope.toml and points.csv.

        Raises DataError: a file is missing, a key is unknown, or a slope, a slip or an SD is out of range.
        """
        file = path / FILE
        table = read_toml(file)
        if table.get("kind") != KIND:
            raise DataError(f"{file}: kind = {table.get('kind')!r}, but slip against slope has kind = '{KIND}'.")
        for key in table:
            if key not in KEYS:
                raise DataError(f"{file}: there is no key '{key}': {closest(key, KEYS)}")
        # Constants that the table [soil] does not declare are those of the rover's usual soil.
        rover = load_named(str(table.get("rover", "nexus6")), file)
        declared = table_in(table, "soil", str(file))
        soil = record_from(Soil, {**own_soil(rover).value.values(), **declared}, f"{file}: [soil]")
        folds, points = read_folded(path / "points.csv", "run", COLUMNS)
        slopes, slip, sd = np.radians(points[:, 0]), points[:, 1:2], points[:, 2]
        _refuse(points, path / "points.csv")
        # The noise model has one SD for each channel, so the stated SDs are averaged as variances.
        mean_sd = np.array([math.sqrt(float(np.nanmean(sd**2)))])
        gravity = gravity_from(table.get("gravity", EARTH), str(file))
        name = printable(str(table.get("name", path.name)))
        return cls(rover, soil, gravity, folds, slopes, slip, mean_sd, declared, name)

    def base_model(self) -> Parts:
        """Return the declared soil with traction and motion resistance of this rover. The search for missing effects
        may add effects to this model.
        """
        # Effects that only act while a rover turns or accelerates have no influence on a steady drive.
        traction = SoilTraction(TorqueTraction(), usual_angles(self.rover))
        acting_effects = [
            effect
            for effect in base_effects(self.soil, self.rover, traction, self.gravity)
            if isinstance(effect, ACTING)
        ]
        return Parts({"soil": self.soil}, tuple(acting_effects))

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return the numbers that are uncertain even if no effect is missing: phi, k and k_1 of the soil, and the
        motion resistance R.
        """
        soil, sds = [], declared_sds(self.declared, Soil, "[soil]")
        for name, unit in (("phi", "rad"), ("k", "m"), ("k_1", "Pa")):
            place = declared_in("soil", name, self.declared, sds)
            soil.append(self.parameter(model, f"soil.{name}", self._sd(name, unit), name != "phi", place))
        return (*soil, self.parameter(model, "MotionResistance.R", R_SD))

    def _sd(self, name: str, unit: str) -> float:
        """Return the declared or assumed prior SD of a soil constant: in rad for phi, and relative to its value for k
        and k_1.
        """
        # k and k_1 are fitted by their logarithms, so their SD is relative to the value.
        sd = declared_sd(self.declared.get(name), unit, f"[soil]: the sd of '{name}'")
        if sd is None:
            return SD[name].undeclared
        return sd if name == "phi" else sd / abs(float(getattr(self.soil, name)))

    @property
    def varied(self) -> np.ndarray:
        """Input of each sample (folds, samples, 1): the slope [rad]."""
        return self.slopes[..., None]

    def along(self) -> tuple[str, np.ndarray]:
        """Return the name and the values of the horizontal axis of figures: the slope of each sample [deg]."""
        return "slope [deg]", np.degrees(self.slopes)

    def insufficient(self) -> str:
        """Return why the data are too few for an answer of the search for missing effects (too few slopes or runs); an
        empty text if they are enough.
        """
        # Slopes that agree within 0.1 deg count as one slope.
        count = len(np.unique(np.round(np.degrees(self.slopes[np.isfinite(self.slopes)]), 1)))
        if count >= MIN_SLOPES and len(self.folds) > 1:
            return ""
        return f"{count} slopes in {len(self.folds)} runs; measure {MIN_SLOPES} slopes or more, in two runs or more."

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the contact effects that may be missing in the model of a steadily turning wheel, as candidates.

        Left out are effects that act only at one place on the ground, effects that change the slip, and the effects
        that the base model already has (ACTING).
        """
        # The slip is what the experiment predicts, so no effect may change it beforehand.
        contact = [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral and not kind.places]
        steady = [kind for kind in contact if not kind.before_slip and not isinstance(kind(), ACTING)]
        return tuple(plain_candidate(reading_traction(kind(), model.effects)) for kind in steady)

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the slips that each model predicts (models, folds, 1, samples): the slips at which the wheels carry
        the rover up.

        All wheels have one common slip S, and statics give the load N_i of each wheel on the slope. With the traction
        f_t of a wheel, the mass m and the gravity g, the predicted slip is the smallest S with sum_i f_t(S, N_i) = m g
        sin(slope). If no S is sufficient, the predicted slip is STUCK.
        """
        slopes = np.nan_to_num(self.slopes).ravel()
        distinct_slopes, at = np.unique(slopes, return_inverse=True)
        loads = [wheel_loads(self.rover, slope, gravity=self.gravity) for slope in distinct_slopes]
        # On a steady drive, the pull of all wheels balances the downhill part of the weight.
        required_pull = self.rover.mass * self.gravity * np.sin(distinct_slopes)
        predicted = []
        for model in models:
            # The pull of each wheel at every slope and slip, summed over the wheels.
            pulls = np.zeros((len(distinct_slopes), len(SLIPS)))
            for number, mount in enumerate(self.rover.wheels):
                wheel_model = RigModel(mount.wheel, model.records["soil"], model.effects)
                load = np.repeat([max(float(slope_loads[number]), 1e-3) for slope_loads in loads], len(SLIPS))
                runs = conditions(load, np.tile(SLIPS, len(distinct_slopes)))
                pulls += predictor(wheel_model, (), runs)(wheel_model.vector()).values[0].reshape(pulls.shape)
            slips = np.full(len(distinct_slopes), STUCK)
            for number, (pull, want) in enumerate(zip(pulls, required_pull, strict=True)):
                # A slip at which the wheel model has no solution (NaN) cannot carry the rover.
                enough = np.flatnonzero(np.nan_to_num(pull, nan=-np.inf) >= want)
                if enough.size and enough[0] == 0:
                    slips[number] = SLIPS[0]
                elif enough.size:
                    # The pull reaches the required value between two neighbouring slips.
                    low, high = int(enough[0]) - 1, int(enough[0])
                    share = (want - pull[low]) / (pull[high] - pull[low])
                    slips[number] = SLIPS[low] + share * (SLIPS[high] - SLIPS[low])
            predicted.append(slips[at].reshape(len(self.folds), 1, -1))
        return np.array(predicted)


ACTING = (SoilTraction, MotionResistance)
"""Effects of the base model of a drive that also act on a steadily turning wheel that runs straight. These effects are
kept; all others are dropped."""


def _refuse(points: np.ndarray, file: Path) -> None:
    """Raise DataError if a slope [deg], a slip or an SD is out of range. These are the columns of `points` (folds, 3,
    samples).
    """
    # NaN fills up short folds and is left out.
    slope, slip, sd = (points[:, at][np.isfinite(points[:, at])] for at in range(3))
    if np.max(np.abs(slope)) > 45.0:
        raise DataError(f"{file}: slope_deg reaches {np.max(np.abs(slope)):g}, but the limit is 45; give degrees.")
    if np.max(np.abs(slip)) > 1.0:
        raise DataError(
            f"{file}: slip reaches {np.max(np.abs(slip)):g}, but must lie between -1 and 1; give the slip ratio of "
            "Eq (1) as a fraction, not in percent."
        )
    if not np.all(sd > 0.0):
        raise DataError(f"{file}: slip_sd must be above 0 in every row: give the SD of repeated drives.")
