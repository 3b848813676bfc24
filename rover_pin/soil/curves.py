"""Families of F(S): the data behind Figs 3 and 6."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.wheel_forces import FORMS, load_traction_factor


@dataclass(frozen=True)
class TractionCurves:
    """F(S) of every form and k: slips (101,), curves by (form, k)."""

    S: np.ndarray
    curves: dict[tuple[str, float], np.ndarray]


def traction_curves(soil: Soil, k: Sequence[float] = (), n: float | None = None) -> TractionCurves:
    """Return F(S) for S from 0 to 1 at the soil's fixed angles, for each k [m] (the soil's own where none is given)."""
    soil = soil if n is None else soil.replace(n=n)
    slips = np.linspace(0.0, 1.0, 101)
    curves = {}
    for value in k or (float(soil.k),):
        varied_soil = soil.replace(k=value)
        for name, form in FORMS.items():
            curves[name, value] = np.array([float(load_traction_factor(S, varied_soil, Wheel(), form)) for S in slips])
    return TractionCurves(slips, curves)
