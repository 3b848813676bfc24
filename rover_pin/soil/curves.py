"""Curves of the traction factor against slip, F(S): the data for figures such as the paper's Figs 3 and 6."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.wheel_forces import FORMS, load_traction_factor


@dataclass(frozen=True)
class TractionCurves:
    """The data of a traction figure: slip ratios S, an array (101,), and the curves of the traction factor F at these
    slips, arrays (101,). The key of a curve is the pair (name of the traction form, shear displacement modulus k [m]).
    """

    S: np.ndarray
    curves: dict[tuple[str, float], np.ndarray]


def traction_curves(
    soil: Soil, k: Sequence[float] = (), n: float | None = None, wheel: Wheel | None = None
) -> TractionCurves:
    """Return curves of the traction factor F(S) for slip ratios S from 0 to 1 and for every traction form (`FORMS`).

    The contact arc has the soil's fixed angles theta_1 and theta_2.

    Parameters
    ----------
    soil : Soil
        The soil.
    k : sequence of float
        Shear displacement moduli k [m], with one curve for each. If the sequence is empty, the soil's own k is used.
    n : float, optional
        Sinkage exponent that replaces the exponent of the soil.
    wheel : Wheel, optional
        The wheel; by default the wheel of Nexus 6.
    """
    # The exponent of the argument replaces the exponent of the soil in all curves.
    soil = soil if n is None else soil.replace(n=n)
    wheel = Wheel() if wheel is None else wheel
    slips, curves = np.linspace(0.0, 1.0, 101), {}
    # One curve for each pair of shear displacement modulus and traction form; one call for each slip is fast enough.
    for value in k or (float(soil.k),):
        varied_soil = soil.replace(k=value)
        for name, form in FORMS.items():
            curves[name, value] = np.array([float(load_traction_factor(S, varied_soil, wheel, form)) for S in slips])
    return TractionCurves(slips, curves)
