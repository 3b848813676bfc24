"""The same wheel pressed in without turning: trials, and where a fit to them and to the runs starts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from rover_pin.base.errors import DataError
from rover_pin.base.files.table import measured_points
from rover_pin.base.files.toml_file import table_in, text_in
from rover_pin.base.public import brief
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.checks import column
from rover_pin.soil.wheel_forces import pressing_force

SHALLOWEST = 0.004
"""Sinkages above this [m] count. Why: before, the contact settles, and the zero of the depth is uncertain."""

SAMPLES = 12
"""Points of a trial that are used, evenly in depth: neighbours are not independent."""

DEEPEST, STRONGEST = 10.0, 1e7
"""Sinkage [m] and force [N] that no wheel is pressed in by. Why: only another unit does."""

EXPONENTS = (0.3, 2.5)

ASSUMED_UNCERTAINTY = 0.1
"""Relative uncertainty that is granted to an independent measurement that states none."""


@brief
class Trial(NamedTuple):
    """One pressing: sinkage [m] and force [N]."""

    name: str
    sinkage: np.ndarray
    force: np.ndarray


def read_trials(path: Path, surface: str) -> tuple[Trial, ...]:
    """Return the trials that pressed the wheel in: rows whose `indenter` is wheel_<surface>, or the only wheel.

    Raises DataError: a missing column, a number that is not finite, or several wheels of which none has this surface.
    """
    table = measured_points(path, ("indenter", "trial", "sinkage_m", "force_N"), ("indenter", "trial"))
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


def declared_trials(document: Mapping[str, Any], folder: Path, where: str, trust: Trust) -> tuple[Trial, ...]:
    """Return the trials of a `rig.toml`'s `penetration`, none where it names none; errors as of `read_trials`."""
    files = table_in(document, "files", where)
    if "penetration" not in files:
        return ()
    surface = text_in(table_in(document, "wheel", where), "surface", where)
    return read_trials(trust.within(folder, text_in(files, "penetration", where), where), surface)


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


def stiffness(trials: tuple[Trial, ...], wheel: Wheel, n: float) -> float:
    """Return the mean K_eff = (k_1 + k_2 b) / b^n of the trials [Pa/m^n], each by least squares."""
    return float(np.mean([_modulus(trial, _unit_force(trial, wheel, n)) for trial in trials]))


def exponent(trials: tuple[Trial, ...], wheel: Wheel) -> float:
    """Return the n that meets all trials best, each with its own K_eff."""

    def misfit(n: float) -> float:
        units = ((trial, _unit_force(trial, wheel, n)) for trial in trials)
        residuals = (trial.force - _modulus(trial, unit) * unit for trial, unit in units)
        return float(sum(residual @ residual for residual in residuals))

    return float(minimize_scalar(misfit, bounds=EXPONENTS, method="bounded", options={"xatol": 1e-3}).x)


def _modulus(trial: Trial, unit: np.ndarray) -> float:
    """Return the K_eff of a trial whose force at 1 Pa/m^n is `unit`."""
    return float(trial.force @ unit / (unit @ unit))


def _unit_force(trial: Trial, wheel: Wheel, n: float) -> np.ndarray:
    """Return the force at K_eff = 1 Pa/m^n, at the depths of a trial."""
    soil = Soil(n=n, k_1=float(wheel.b) ** n, k_2=0.0)
    return np.array([float(pressing_force(float(h), wheel, soil)) for h in trial.sinkage])
