"""The same wheel pressed in without turning: an independent measurement of the pressure-sinkage constants."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from rover_pin.contact import Soil, Wheel
from rover_pin.errors import DataError
from rover_pin.measurements.checks import column
from rover_pin.measurements.tables import read_table
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.traction import wheel_forces

SHALLOWEST = 0.004
"""Sinkages above this [m] count: before, the contact settles and the zero of the depth is uncertain."""

SAMPLES = 40
"""Points of a trial that are used, evenly in depth: neighbours are not independent."""

DEEPEST, STRONGEST = 10.0, 1e7
"""Sinkage [m] and force [N] that no wheel is pressed in by."""

EXPONENTS = (0.3, 2.5)


class Trial(NamedTuple):
    """One pressing: sinkage [m] and force [N]."""

    name: str
    sinkage: np.ndarray
    force: np.ndarray


class Pressed(NamedTuple):
    """What the trials say at an exponent n: modulus K_eff = (k_1 + k_2 b) / b^n of each [Pa/m^n]."""

    n: float
    moduli: np.ndarray
    trials: tuple[str, ...]

    @property
    def mean(self) -> float:
        """Mean K_eff of the trials [Pa/m^n]."""
        return float(np.mean(self.moduli))


def read_trials(path: Path, surface: str) -> tuple[Trial, ...]:
    """Return the trials that pressed the wheel in: rows whose `indenter` is wheel_<surface>, or the only wheel.

    Raises
    ------
    DataError
        A missing column, a number that is not finite, or several wheels of which none has this surface.
    """
    table = read_table(path, ("indenter", "trial", "sinkage_m", "force_N"))
    kinds = [kind for kind in dict.fromkeys(map(str, table["indenter"])) if kind.startswith("wheel")]
    chosen = f"wheel_{surface}" if f"wheel_{surface}" in kinds else kinds[0] if len(kinds) == 1 else ""
    if kinds and not chosen:
        raise DataError(
            f"{path}: several wheels were pressed in ({', '.join(kinds)}); write surface = '...' under [wheel] of "
            "rig.toml to say which one drove."
        )
    where = path.name
    driven = table[table["indenter"].map(str) == chosen]
    rows = driven[column(driven["sinkage_m"], "sinkage_m", where) > SHALLOWEST] if len(driven) else driven
    keys = [name for name in ("box", "trial") if name in table]
    return tuple(_trial(str(name), rows.loc[group.index], where) for name, group in rows.groupby(keys))


def _trial(name: str, rows: pd.DataFrame, where: str) -> Trial:
    depth, force = column(rows["sinkage_m"], "sinkage_m", where), column(rows["force_N"], "force_N", where)
    for values, what, most in ((depth, "sinkage_m", DEEPEST), (force, "force_N", STRONGEST)):
        if np.abs(values).max() > most:
            raise DataError(
                f"{where}: {what} of trial {name} reaches {np.abs(values).max():g}; give metres and newtons."
            )
    order = np.argsort(depth)
    even = np.linspace(depth.min(), depth.max(), SAMPLES)
    return Trial(name, even, np.interp(even, depth[order], force[order]))


def press(trials: tuple[Trial, ...], wheel: Wheel, n: float) -> Pressed:
    """Return K_eff of each trial by least squares: no shear, the arc reaches as far behind as in front."""
    moduli = []
    for trial in trials:
        unit = _unit_force(trial, wheel, n)
        moduli.append(float(trial.force @ unit / (unit @ unit)))
    return Pressed(n, np.array(moduli), tuple(trial.name for trial in trials))


def exponent(trials: tuple[Trial, ...], wheel: Wheel) -> float:
    """Return the n that meets all trials best, each with its own K_eff."""

    def misfit(n: float) -> float:
        found = press(trials, wheel, n)
        rest = [
            trial.force - modulus * _unit_force(trial, wheel, n)
            for trial, modulus in zip(trials, found.moduli, strict=True)
        ]
        return float(sum(residual @ residual for residual in rest))

    return float(minimize_scalar(misfit, bounds=EXPONENTS, method="bounded", options={"xatol": 1e-3}).x)


def _unit_force(trial: Trial, wheel: Wheel, n: float) -> np.ndarray:
    """Return the force at K_eff = 1 Pa/m^n, at the depths of a trial."""
    soil = Soil(c=0.0, phi=0.0, n=n, k_1=float(wheel.b) ** n, k_2=0.0)
    arcs = [SinkageAngles().angles(float(h), wheel, soil)[0] for h in trial.sinkage]
    return np.array([float(wheel_forces(0.0, arc, -arc, wheel, soil).f_n) for arc in arcs])
