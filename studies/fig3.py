"""Fig 3: the load-traction factor against slip for various k, with three definitions of the factor.

Question
    Which family of curves do Eqs (2)-(7) give "by changing S and k, while holding other parameters constant at c =
    0.005 N/m^2, phi = 30 deg, theta_1 = 35 deg, theta_2 = -5 deg"?
Method
    `load_traction_factor` for r = 45 mm and the missing n = 1 (assumed), with three definitions of the traction factor:
    net (drawbar pull / normal force f_n), torque (T / (r f_n), with the wheel torque T) and gross (thrust / f_n).
Result
    With each definition, the curves of all k form a family, and all curves rise with S. The net factor, F = f_t / f_n
    as printed, is negative for Table 1's k = 0.05 m until S = 0.99, because theta_1 = 35 deg makes the compaction
    resistance large, and at r / k = 0.9 the shear is not fully developed. For this k, the torque factor T / (r f_n)
    goes from 0.018 to 0.182.
What the paper says
    "the vertical axis indicates the ratio of the traction force (drawbar pull) and normal force", which is the net
    factor.
What differs
    The curves of the paper are not available as numbers; only its words are compared (see tests/paper).

Run: python studies/fig3.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from rover_pin.parameters import NEXUS6_WHEEL, TABLE_1
from rover_pin.soil.wheel_forces import FORMS, load_traction_factor

K_MM = (5, 10, 15, 25, 50, 100)
TITLES = {
    "net": "net: f_t / f_n (the text)",
    "torque": "torque: T / (r f_n) (how it was measured)",
    "gross": "gross: thrust / f_n",
}


def main() -> None:
    """Compute the curves, write them with the figure, and print the factors at four slips."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="11 slips instead of 101")
    parser.add_argument("--out", type=Path, default=Path("out/fig3"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    curves = family(np.linspace(0, 1, 11 if options.quick else 101))
    curves.to_csv(options.out / "fig3.csv", index=False, float_format="%.6g")
    draw(curves, options.out / "fig3.png")
    # Four slips are enough for the printed table; the CSV has all.
    table = curves[curves.S.isin([0.0, 0.1, 0.5, 1.0])].pivot_table(index=["form", "k_mm"], columns="S", values="F")
    print(table.round(3).to_string())
    print(f"written: {options.out / 'fig3.csv'}, {options.out / 'fig3.png'}")


def family(slips: np.ndarray) -> pd.DataFrame:
    """Return the traction factor F against slip for each definition of F and each k."""
    # Every form with every k over all slips, as a long table.
    rows = [
        (name, k, S, load_traction_factor(float(S), TABLE_1.replace(k=k / 1000), NEXUS6_WHEEL, form))
        for name, form in FORMS.items()
        for k in K_MM
        for S in slips.round(6)
    ]
    return pd.DataFrame(rows, columns=["form", "k_mm", "S", "F"])


def draw(curves: pd.DataFrame, path: Path) -> None:
    """Draw the traction factor F against slip for each k, with one panel for each form of traction."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.4), sharey=True, layout="constrained")
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.9, len(K_MM)))
    for axis, (name, title) in zip(axes, TITLES.items(), strict=True):
        for k, colour in zip(K_MM, colours, strict=True):
            curve = curves[(curves.form == name) & (curves.k_mm == k)]
            # The paper's own value of k is drawn thicker.
            label = f"k = {k} mm" + (" (Table 1)" if k == 50 else "")
            axis.plot(curve.S, curve.F, color=colour, lw=2.6 if k == 50 else 1.4, label=label)
        axis.axhline(0, color="black", lw=0.8)
        axis.set(title=title, xlabel="slip ratio S [-]", xlim=(-0.02, 1.02))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("load-traction factor F [-]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    figure.suptitle(
        "Fig 3 by Eqs (2)-(7): c = 0.005 Pa, phi = 30 deg, theta_1 = 35 deg, theta_2 = -5 deg, n = 1 (assumed)"
    )
    figure.savefig(path, dpi=130)
    plt.close(figure)


if __name__ == "__main__":
    main()
