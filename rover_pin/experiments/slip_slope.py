"""Slip against slope of a whole rover, as most publications have it: steady drives up (or down) slopes, one point each.

DATA is a folder with slope.toml and points.csv. slope.toml as in::

    kind = "slip-slope"
    name = "our rover on dry sand"
    rover = "rover.toml"                 # a name, or a TOML beside it
    gravity = 9.81
    [soil]                               # what is known of it: { value, unit, sd }
    phi = { value = 34.0, unit = "deg", sd = 2.0 }

points.csv has the columns run, slope_deg, slip and slip_sd; a run's points are left out together.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import declared_sd, declared_sds, record_from
from rover_pin.contact import Soil
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.standalone import Parts, Standalone
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
"""Slips at which the pull is worked out; between them it is interpolated."""
STUCK = 1.0
"""Slip of a rover on a slope that no slip climbs."""
R_SD = 0.15
"""SD of the motion resistance (assumed)."""
FEWEST = 4
"""Slopes from which a set is not refused. Why: three numbers are uncertain."""


@dataclass(frozen=True, eq=False)
class SlipSlope(Standalone):
    """The experiment: slopes (folds, samples) [rad], slips observed there (folds, 1, samples), and their SD."""

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

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the experiment in a folder."""
        file = path / FILE
        table = read_toml(file)
        if table.get("kind") != KIND:
            raise DataError(f"{file}: kind = {table.get('kind')!r}, but slip against slope has kind = '{KIND}'.")
        for key in table:
            if key not in KEYS:
                raise DataError(f"{file}: there is no key '{key}': {closest(key, KEYS)}")
        rover = load_named(str(table.get("rover", "nexus6")), file)
        declared = table_in(table, "soil", str(file))
        soil = record_from(Soil, {**own_soil(rover).value.values(), **declared}, f"{file}: [soil]")
        folds, points = read_folded(path / "points.csv", "run", COLUMNS)
        slopes, slip, sd = np.radians(points[:, 0]), points[:, 1:2], points[:, 2]
        _refuse(points, path / "points.csv")
        mean_sd = np.array([math.sqrt(float(np.nanmean(sd**2)))])
        gravity = gravity_from(table.get("gravity", EARTH), str(file))
        name = str(table.get("name", path.name))
        return cls(rover, soil, gravity, folds, slopes, slip, mean_sd, declared, name)

    def base_model(self) -> Parts:
        """Return the soil as declared, with the traction and the resistance of a drive of this rover."""
        traction = SoilTraction(TorqueTraction(), usual_angles(self.rover))
        acting_effects = [
            effect
            for effect in base_effects(self.soil, self.rover, traction, self.gravity)
            if isinstance(effect, ACTING)
        ]
        return Parts({"soil": self.soil}, tuple(acting_effects))

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return phi, k, k_1 and the motion resistance, whose value at S = 0.05 on the flat is an assumption."""
        soil = (
            self.parameter(model, f"soil.{name}", self._sd(name, unit), name != "phi", self._declaration(name))
            for name, unit in (("phi", "rad"), ("k", "m"), ("k_1", "Pa"))
        )
        return (*soil, self.parameter(model, "MotionResistance.R", R_SD))

    def _declaration(self, name: str) -> str:
        return declared_in("soil", name, self.declared, declared_sds(self.declared, Soil, "[soil]"))

    def _sd(self, name: str, unit: str) -> float:
        """Return the SD of a soil constant, relative but phi's: as declared, else as of one that nobody declares."""
        sd = declared_sd(self.declared.get(name), unit, f"[soil]: the sd of '{name}'")
        if sd is None:
            return SD[name].undeclared
        return sd if name == "phi" else sd / abs(float(getattr(self.soil, name)))

    @property
    def varied(self) -> np.ndarray:
        """The slopes."""
        return self.slopes[..., None]

    def along(self) -> tuple[str, np.ndarray]:
        """Return the slopes [deg]."""
        return "slope [deg]", np.degrees(self.slopes)

    def insufficient(self) -> str:
        """Return why too few slopes tell nothing."""
        count = len(np.unique(np.round(np.degrees(self.slopes[np.isfinite(self.slopes)]), 1)))
        if count >= FEWEST and len(self.folds) > 1:
            return ""
        return f"{count} slopes in {len(self.folds)} runs; measure {FEWEST} slopes or more, in two runs or more."

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the contact effects that act at a steady wheel, none of a place and none that changes the slip."""
        mine = [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral and not kind.places]
        able = [kind for kind in mine if not kind.before_slip and not isinstance(kind(), ACTING)]
        return tuple(plain_candidate(reading_traction(kind(), model.effects)) for kind in able)

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the slips (models, folds, 1, samples) at which the wheels' pulls carry the rover up each slope.

        sum over the wheels of f_t(S, N_i) = m g sin(slope), the loads N_i across the slope by statics, all wheels at
        one slip; the least slip that does it, or STUCK.
        """
        return np.array([self._slips(model) for model in models])

    def _slips(self, model: Parts) -> np.ndarray:
        slopes = np.nan_to_num(self.slopes).ravel()
        distinct_slopes, at = np.unique(slopes, return_inverse=True)
        loads = [wheel_loads(self.rover, slope, gravity=self.gravity) for slope in distinct_slopes]
        pulls = np.zeros((len(distinct_slopes), len(SLIPS)))
        for number, mount in enumerate(self.rover.wheels):
            wheel_model = RigModel(mount.wheel, model.records["soil"], model.effects)
            load = np.repeat([max(float(slope_loads[number]), 1e-3) for slope_loads in loads], len(SLIPS))
            runs = conditions(load, np.tile(SLIPS, len(distinct_slopes)))
            pulls += predictor(wheel_model, (), runs)(wheel_model.vector()).values[0].reshape(pulls.shape)
        required_pull = self.rover.mass * self.gravity * np.sin(distinct_slopes)
        slips = np.array([_least(pull, want) for pull, want in zip(pulls, required_pull, strict=True)])
        return slips[at].reshape(len(self.folds), 1, -1)


ACTING = (SoilTraction, MotionResistance)
"""What of a drive's base effects acts at a steady wheel that runs straight."""


def _least(pull: np.ndarray, required_pull: float) -> float:
    """Return the least slip at which the pull is what is asked, straight between the worked-out ones."""
    enough = np.flatnonzero(np.nan_to_num(pull, nan=-np.inf) >= required_pull)
    if not enough.size:
        return STUCK
    at = int(enough[0])
    if at == 0:
        return float(SLIPS[0])
    share = (required_pull - pull[at - 1]) / (pull[at] - pull[at - 1])
    return float(SLIPS[at - 1] + share * (SLIPS[at] - SLIPS[at - 1]))


def _refuse(points: np.ndarray, file: Path) -> None:
    slope, slip, sd = (points[:, at][np.isfinite(points[:, at])] for at in range(3))
    if np.max(np.abs(slope)) > 45.0:
        raise DataError(f"{file}: slope_deg reaches {np.max(np.abs(slope)):g}; give degrees, within 45.")
    if np.max(np.abs(slip)) > 1.0:
        raise DataError(f"{file}: slip reaches {np.max(np.abs(slip)):g}; give Eq (1)'s fraction, not percent.")
    if not np.all(sd > 0.0):
        raise DataError(f"{file}: slip_sd must be above 0: give the scatter of repeated drives.")
