"""Pressing trials of a wheel rig: the wheel, or a plate of a bevameter, is pressed into the soil without turning, and
sinkage and force are recorded.

The relation between force and sinkage determines the soil's exponent n and the sum k_1 + k_2 b of its pressure moduli,
where b is the width of the wheel or of the plate. Plates of two widths determine k_1 and k_2.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from rover_pin.base.errors import DataError
from rover_pin.base.files.table import measured_points
from rover_pin.base.files.toml_file import table_in, text_in
from rover_pin.base.public import brief
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.checks import column
from rover_pin.soil.wheel_forces import plate_force, pressing_force

MIN_SINKAGE = 0.004
"""Smallest sinkage [m] of a reading that is used (assumed). At smaller sinkage the contact settles, and an error of the
depth's zero would be a large part of the sinkage."""

PLATE, PLATE_SIZES = "plate", ("plate_diameter_m", "plate_width_m", "plate_length_m")
"""Indenter of the trials of a plate, and names of the columns with the sizes of the plate."""

SAMPLES = 12
"""Number of evenly spaced depths that represent the readings of a trial, because neighbouring readings are not
independent."""

MAX_SINKAGE, MAX_FORCE = 10.0, 1e7
"""Largest accepted sinkage (MAX_SINKAGE) [m] and force (MAX_FORCE) [N] of a pressing trial. No trial reaches these
values, so that a larger value must have been given in another unit."""

EXPONENTS = (0.3, 2.5)
"""Bounds of the search for the sinkage exponent n (assumed). Dry sand has an exponent of about 1. Without bounds, noisy
trials could give an exponent that no soil has."""

ASSUMED_UNCERTAINTY = 0.1
"""Relative uncertainty (assumed) of a soil constant from a separate measurement that states no uncertainty."""


class Plate(NamedTuple):
    """A flat plate that is pressed into the soil: the width b in the pressure law [m] and the area [m^2].

    b is the radius of a round plate, and the shorter side of a rectangular plate (Bekker).
    """

    b: float
    area: float


@brief
class Trial(NamedTuple):
    """One pressing trial: sinkage [m] and force [N], each (samples,), of the wheel or of a plate."""

    name: str
    sinkage: np.ndarray
    force: np.ndarray
    plate: Plate | None = None
    "the pressed plate; None for the wheel"


def read_trials(path: Path, surface: str) -> tuple[Trial, ...]:
    """Read the pressing trials of one wheel and of plates from a penetration file.

    Parameters
    ----------
    path : Path
        Table with the columns `indenter`, `trial`, `sinkage_m`, `force_N`, and optionally `box`. Rows with the indenter
        `plate` also have the column `plate_diameter_m` of a round plate, or `plate_width_m` and `plate_length_m`.
    surface : str
        Surface of the wheel that drove in the runs. The rows with the indenter `wheel_<surface>` are taken, or the rows
        of the only wheel in the file.

    Raises
    ------
    DataError
        A missing column, a number that is not finite, several wheels without this surface, or a plate without
        dimensions.
    """
    table = measured_points(path, ("indenter", "trial", "sinkage_m", "force_N"), ("indenter", "trial"))
    # Other indenters, such as cones, are not used.
    kinds = [kind for kind in dict.fromkeys(map(str, table["indenter"])) if kind.startswith("wheel")]
    chosen = f"wheel_{surface}" if f"wheel_{surface}" in kinds else kinds[0] if len(kinds) == 1 else ""
    if kinds and not chosen:
        raise DataError(
            f"{path}: several wheels were pressed in ({', '.join(kinds)}); write surface = '...' under [wheel] of "
            "rig.toml to state which wheel drove."
        )
    where = path.name
    used = table[table["indenter"].map(str).isin([chosen, PLATE])]
    rows = used[column(used["sinkage_m"], "sinkage_m", where) > MIN_SINKAGE] if len(used) else used
    keys = [name for name in ("box", "trial") if name in table]
    # Trials of a plate are also distinguished by the sizes of the plate, which are empty in the rows of the wheel.
    sizes = [name for name in PLATE_SIZES if name in table]
    trials = []
    for parts, group in rows.groupby(["indenter", *sizes, *keys], dropna=False):
        # pandas names a group of several keys by a tuple, whose last parts become the name of the trial.
        name = ", ".join(map(str, parts[1 + len(sizes) :]))
        plate = _plate(dict(zip(sizes, parts[1 : 1 + len(sizes)], strict=True)), where) if parts[0] == PLATE else None
        name = name if plate is None else f"plate with b = {1e3 * plate.b:.4g} mm, {name}"
        depth, force = (column(rows.loc[group.index, key], key, where) for key in ("sinkage_m", "force_N"))
        # Values that are too large are in millimetres or kilonewtons.
        for values, what, limit in ((depth, "sinkage_m", MAX_SINKAGE), (force, "force_N", MAX_FORCE)):
            if np.abs(values).max() > limit:
                raise DataError(
                    f"{where}: {what} of trial {name} reaches {np.abs(values).max():g}; give metres and newtons."
                )
        # The force is interpolated to evenly spaced depths; interpolation needs increasing depths.
        order = np.argsort(depth)
        even = np.linspace(depth.min(), depth.max(), SAMPLES)
        trials.append(Trial(name, even, np.interp(even, depth[order], force[order]), plate))
    return tuple(trials)


def _plate(sizes: Mapping[str, Any], where: str) -> Plate:
    """Return the plate of one trial from its sizes [m] in a penetration file; `where` is the name of the file.

    Raises DataError if neither a diameter nor width and length are given, or if a size is not a length below 10 m.
    """
    given = {name: float(value) for name, value in sizes.items() if isinstance(value, (int, float)) and value == value}
    for name, value in given.items():
        if not 0.0 < value < MAX_SINKAGE:
            raise DataError(f"{where}: {name} = {value:g} is not a length in metres.")
    diameter, *sides = (given.get(name) for name in PLATE_SIZES)
    if diameter is not None and sides == [None, None]:
        return Plate(diameter / 2.0, math.pi * diameter**2 / 4.0)
    if diameter is None and None not in sides:
        return Plate(min(given.values()), math.prod(given.values()))
    raise DataError(f"{where}: give {PLATE_SIZES[0]} of a round plate, or {PLATE_SIZES[1]} and {PLATE_SIZES[2]}.")


def declared_trials(document: Mapping[str, Any], folder: Path, where: str, trust: Trust) -> tuple[Trial, ...]:
    """Return the pressing trials in the penetration file that rig.toml names; an empty tuple if rig.toml names no such
    file.

    `document` is the content of rig.toml in `folder`, and `where` its name for messages. Raises DataError if
    `read_trials` refuses the file, or if the file lies outside the folder and `trust` does not allow that.
    """
    # The trust check prevents that a data set from elsewhere names a file outside its folder.
    files = table_in(document, "files", where)
    if "penetration" not in files:
        return ()
    surface = text_in(table_in(document, "wheel", where), "surface", where)
    return read_trials(trust.within(folder, text_in(files, "penetration", where), where), surface)


def stiffness(trials: tuple[Trial, ...], wheel: Wheel, n: float) -> float:
    """Return the soil's modulus K_eff = (k_1 + k_2 b) / b^n [Pa/m^n] for a given exponent n, as the mean over the
    pressing trials.

    b is the width of the wheel, and k_1 and k_2 are the soil's pressure moduli. K_eff of each trial is fitted by least
    squares.
    """
    return float(np.mean([_modulus(trial, _unit_force(trial, wheel, n)) for trial in trials]))


def exponent(trials: tuple[Trial, ...], wheel: Wheel) -> float:
    """Return the sinkage exponent n that fits the pressing trials best: the one with the smallest sum of squared force
    residuals.

    The sum is over all trials, and each trial has its own fitted modulus K_eff.
    """

    def misfit(n: float) -> float:
        """Return the sum of squared force residuals at the exponent n."""
        units = ((trial, _unit_force(trial, wheel, n)) for trial in trials)
        residuals = (trial.force - _modulus(trial, unit) * unit for trial, unit in units)
        return float(sum(residual @ residual for residual in residuals))

    return float(minimize_scalar(misfit, bounds=EXPONENTS, method="bounded", options={"xatol": 1e-3}).x)


def _modulus(trial: Trial, unit: np.ndarray) -> float:
    """Return the soil's modulus K_eff [Pa/m^n] that fits the forces of one pressing trial best by least squares.

    `unit` (samples,) is the force at the trial's depths for K_eff = 1 Pa/m^n.
    """
    return float(trial.force @ unit / (unit @ unit))


def _unit_force(trial: Trial, wheel: Wheel, n: float) -> np.ndarray:
    """Return the force [N] (samples,) at the depths of a pressing trial for a soil with the modulus K_eff =
    1 Pa/m^n.
    """
    # k_1 = b^n and k_2 = 0 give K_eff = (k_1 + k_2 b) / b^n = 1.
    soil = Soil(n=n, k_1=float(wheel.b) ** n, k_2=0.0)
    if trial.plate is not None:
        return np.asarray(plate_force(trial.sinkage, *trial.plate, soil))
    return np.array([float(pressing_force(float(h), wheel, soil)) for h in trial.sinkage])
