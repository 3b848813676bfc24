"""Fig 6: the theoretical curve of Table 1 compared with the text's statements on it.

Question
    Is "a theoretical curve that makes a best fit with the experimental plots", drawn with Table 1, as sections 4 and 5
    describe it: does it rise with the slip, give traction at S = 1, let the rover travel with a slip near 0, and hold
    the rover up to 12 deg?
Method
    `load_traction_factor` with Table 1, r = 45 mm, with three definitions of the traction factor: net (drawbar pull /
    normal force f_n), torque (T / (r f_n), with the wheel torque T) and gross (thrust / f_n). The paper does not state
    n, so 0.5 to 2 is shown as a band around n = 1. The literature's sand of section 4.1 is shown for comparison.
Result
    From S = 0 to S = 1 the net factor goes from -0.164 to +0.001, so that there is no traction below S = 0.99. The
    torque factor goes from 0.018 to 0.182 (a slope of 10.3 deg), the gross factor from 0.017 to 0.179 (10.2 deg). With
    the literature's phi = 32 deg and k = 25 mm the torque factor reaches 0.319.
What the paper says
    "the plots show an increasing trend"; "the traction force exists even at S = 1"; the grip is lost at 12 deg, tan 12
    deg = 0.213. "The traction force is evaluated from the angular velocity of the wheel using the characteristics of
    the corresponding motor", so the plots show the torque factor.
What differs
    The net factor contradicts the slope of 12 deg and travel at small slip. The maximum of the torque factor
    corresponds to a slope that is 1.7 deg too low. For a maximum at 12 deg, the net factor would need k = 14.5 mm
    instead of 50 mm. The measured points are not available as numbers.

Run: python studies/fig6.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from rover_pin.parameters import NEXUS6_WHEEL, SOILS
from rover_pin.soil.wheel_forces import FORMS, load_traction_factor

EXPONENTS = (0.5, 1.0, 1.5, 2.0)
COLOURS = {"net": "tab:red", "torque": "tab:blue", "gross": "tab:green"}
SETS = {"table-1": "Table 1", "literature-sand": "literature sand (section 4.1)"}


def main() -> None:
    """Compute the curves, write them with the figure, and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="11 slips instead of 101")
    parser.add_argument("--out", type=Path, default=Path("out/fig6"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    curves = theory(np.linspace(0, 1, 11 if options.quick else 101))
    curves.to_csv(options.out / "fig6.csv", index=False, float_format="%.6g")
    draw(curves, options.out / "fig6.png")
    print(summary(curves).to_string(index=False))
    print(f"written: {options.out / 'fig6.csv'}, {options.out / 'fig6.png'}")


def theory(slips: np.ndarray) -> pd.DataFrame:
    """Return F over slip for each soil, exponent n and form."""
    # Every soil, exponent and form over all slips, as a long table.
    rows = [
        (name, n, form, S, load_traction_factor(float(S), SOILS[name].replace(n=n), NEXUS6_WHEEL, FORMS[form]))
        for name in SETS
        for n in EXPONENTS
        for form in FORMS
        for S in slips.round(6)
    ]
    return pd.DataFrame(rows, columns=["soil", "n", "form", "S", "F"])


def summary(curves: pd.DataFrame) -> pd.DataFrame:
    """Return a table by soil and form of traction: the traction factor F at the slips 0, 0.1 and 1, whether F rises
    throughout, and the steepest slope that F(S) holds.
    """
    rows = []
    # The paper's statements refer to the assumed n = 1.
    for (soil, form), curve in curves[curves.n == 1.0].groupby(["soil", "form"], sort=False):
        F = curve.set_index("S").F
        steepest = math.degrees(math.atan(max(F.max(), 0.0)))
        rows.append((soil, form, F[0.0], F[0.1], F[1.0], bool((F.diff().dropna() > 0).all()), steepest))
    names = ["soil", "form", "F(0)", "F(0.1)", "F(1)", "rises", "steepest_deg"]
    return pd.DataFrame(rows, columns=names).round(3)


def draw(curves: pd.DataFrame, path: Path) -> None:
    """Draw the traction factor F against slip, with a band for the range of the exponent n, and the F that the slope of
    Fig 8 needs.
    """
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.8), sharey=True, layout="constrained")
    for axis, (soil, title) in zip(axes, SETS.items(), strict=True):
        for form, colour in COLOURS.items():
            of_form = curves[(curves.soil == soil) & (curves.form == form)]
            curve = of_form.pivot_table(index="S", columns="n", values="F")
            style = "--" if form == "gross" else "-"
            axis.plot(curve.index, curve[1.0], color=colour, ls=style, lw=2, label=f"{form}, n = 1")
            # The gross form nearly coincides with the torque form, so its band would hide the other.
            if form != "gross":
                low, high, label = curve.min(axis=1), curve.max(axis=1), f"{form}, n = 0.5 to 2"
                axis.fill_between(curve.index, low, high, color=colour, alpha=0.15, lw=0, label=label)
        # A rover that climbs 12 deg needs F of at least tan 12 deg.
        axis.axhline(math.tan(math.radians(12)), color="black", ls=":", lw=1.5, label="tan 12 deg (Fig 8)")
        axis.axhline(0, color="black", lw=0.8)
        axis.set(title=title, xlabel="slip ratio S [-]", xlim=(-0.02, 1.02))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("load-traction factor F [-]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


if __name__ == "__main__":
    main()
