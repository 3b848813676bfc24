"""Can the points of Fig 6 tell Table 1's k and phi?

Question
    Section 4.1 reads phi = 30 deg and k = 0.05 m off scattered traction factors. How well do such points tell them?
Method
    Scattered single measurements are drawn from Table 1 itself (so the truth is known): 11 slips from 0 to 1, 5
    repeats, scatter 0.067 (assumed), which gives means with an SD of 0.03. `identify` fits k and phi with n, theta_1,
    theta_2 and c held; the experiment is repeated with fresh scatter, for smaller k, and for the torque form.
Result
    At Table 1's k = 50 mm: SD of ln k 1.9 and of phi 39 deg, correlated by 0.999. 95 % intervals without noise: k from
    9 to 199 mm, phi from 10 deg to its bound of 60 deg, and k ends at 199 mm only because phi ends at 60 deg. A third
    of 300 repeated experiments (36 %) put phi on that bound. Neither parameter may be called found. The same points
    would tell k = 5 mm (3.8 to 6.6 mm, phi 28.0 to 32.4 deg) and k = 10 mm (6.9 to 15.7 mm, phi 26 to 36 deg); 20 mm
    is already open. Net and torque form tell the same. The stated intervals hold the truth in 92 to 96 % of repeats.
What the paper says
    "The data plots are relatively scattered, then mean values at each slip ratio are depicted with an error bar
    indicating +-1SD"; "the specific parameters are used [...] as listed in Table 1".
What differs
    The paper prints no uncertainty. Where j / k stays small the shear stress is sigma tan(phi) j / k: only the ratio
    tan(phi) / k shows, and r = 45 mm against k = 50 mm is such a case. Fig 6's own points are not published as numbers.

Run: python studies/identify_table1.py [--quick] [--out DIR]
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
from matplotlib.axes import Axes

from rover_pin.contact import Soil
from rover_pin.identification.identify import Search, build, identify, profile
from rover_pin.identification.result import Identification
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.parameters import NEXUS6_WHEEL, TABLE_1
from rover_pin.soil.traction import NetTraction, TorqueTraction, TractionForm, load_traction_factor

FREE = ("k", "phi")
SLIPS, REPEATS, SCATTER = np.linspace(0, 1, 11), 5, 0.067
FORMS = (NetTraction(), TorqueTraction())
K_MM = (2, 5, 10, 20, 50)
DEG = math.degrees(1.0)
SHORT = TABLE_1.replace(k=0.005)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="fewer repeated experiments and a coarser map")
    options.add_argument("--out", type=Path, default=Path("out"))
    asked = options.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    repeats, cells = (20, 25) if asked.quick else (300, 70)

    table = pd.DataFrame([row(K / 1000, form, repeats) for form in FORMS for K in K_MM])
    table.to_csv(asked.out / "identify_table1.csv", index=False)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    points = measured(TABLE_1, FORMS[0], seed=1)
    result = identify(points, TABLE_1, FREE)
    print(f"\nTable 1, net form, one experiment:\n{result.report()}")
    draw(points, result, repeats, cells).savefig(asked.out / "identify_table1.png", dpi=150)


def measured(soil: Soil, form: TractionForm, seed: int) -> TractionPoints:
    """Return means of scattered single measurements of a known soil, as the paper describes its own."""
    slip = np.repeat(SLIPS, REPEATS)
    clean = np.array([load_traction_factor(float(S), soil, NEXUS6_WHEEL, form) for S in slip])
    scattered = clean + np.random.default_rng(seed).normal(0, SCATTER, slip.size)
    return TractionPoints.from_scatter(slip, scattered, NEXUS6_WHEEL, form)


def row(k: float, form: TractionForm, repeats: int) -> dict[str, float | str]:
    """Return what points without noise would tell at this true k, and how repeated experiments spread."""
    soil = TABLE_1.replace(k=k)
    clean = np.array([load_traction_factor(float(S), soil, NEXUS6_WHEEL, form) for S in SLIPS])
    ideal = identify(TractionPoints(SLIPS, clean, SCATTER / math.sqrt(REPEATS), form=form), soil, FREE)
    fits = [identify(measured(soil, form, seed), soil, FREE, search=Search(starts=1)) for seed in range(repeats)]
    held = [[e.low <= getattr(soil, e.name) <= e.high for e in fit.estimates] for fit in fits]
    return {
        "form": form.name,
        "k_mm": 1000 * k,
        "sd_ln_k": ideal["k"].sd / k,
        "sd_phi_deg": ideal["phi"].sd * DEG,
        "correlation": ideal.correlation[0, 1],
        "k_low_mm": 1000 * ideal["k"].low,
        "k_high_mm": 1000 * ideal["k"].high,
        "phi_low_deg": ideal["phi"].low * DEG,
        "phi_high_deg": ideal["phi"].high * DEG,
        "found": " ".join(ideal.identified) or "none",
        "fits_on_phi_bound": np.mean([fit.soil.phi > math.radians(59.9) for fit in fits]),
        "k_95_holds_truth": np.mean([k_held for k_held, _ in held]),
        "phi_95_holds_truth": np.mean([phi_held for _, phi_held in held]),
    }


def draw(points: TractionPoints, result: Identification, repeats: int, cells: int) -> plt.Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11, 8.5), layout="constrained")
    draw_points(axes[0, 0], points, result)
    draw_valley(axes[0, 1], points, repeats, cells)
    draw_profiles(axes[1, 0])
    draw_ratio(axes[1, 1], repeats)
    figure.suptitle("What the points of Fig 6 tell of k and phi (data drawn from Table 1 itself, SD of a mean 0.03)")
    return figure


def draw_points(axis: Axes, points: TractionPoints, result: Identification) -> None:
    """Fit, and two soils at the ends of the interval of k: eyes cannot part them."""
    axis.errorbar(points.slip, points.factor, points.sd, fmt="ko", capsize=3, label="means +-1 SD of the mean")
    fine = np.linspace(0, 1, 60)
    for k, style in ((None, "-"), (max(result["k"].low, 1e-4), "--"), (min(result["k"].high, 10.0), ":")):
        soil = result.soil if k is None else identify(points, TABLE_1.replace(k=k), ("phi",)).soil
        curve = [load_traction_factor(float(S), soil, NEXUS6_WHEEL) for S in fine]
        label = f"k = {1000 * soil.k:.0f} mm, phi = {soil.phi * DEG:.0f} deg"
        axis.plot(fine, curve, style, label=("best fit: " if k is None else "end of the 95 %: ") + label)
    axis.set(
        xlabel="slip ratio S [-]", ylabel="F = f_t / f_n [-]", title="One experiment at Table 1", ylim=(-0.29, 0.05)
    )
    axis.legend(loc="lower right")


def draw_valley(axis: Axes, points: TractionPoints, repeats: int, cells: int) -> None:
    """chi2 over (k, phi) with the line of constant tan(phi) / k, and fits of repeated experiments."""
    k, phi = np.geomspace(0.002, 2, cells), np.linspace(3, 60, cells)
    problem = build(points, TABLE_1, FREE, {})
    coordinate = problem.space.axes[0].coordinate, problem.space.axes[1].coordinate
    at = [[problem.chi2(np.array([coordinate[0].u(x), coordinate[1].u(y / DEG)])) for x in k] for y in phi]
    rise = np.array(at) - np.min(at)
    filled = axis.contourf(1000 * k, phi, np.minimum(rise, 30), levels=[0, 1, 3.84, 5.99, 10, 20, 30], cmap="viridis_r")
    axis.figure.colorbar(filled, ax=axis, label="rise of chi2 (shown to 30)")
    ratio = math.tan(TABLE_1.phi) / TABLE_1.k
    axis.plot(1000 * k, np.degrees(np.arctan(ratio * k)), "w--", label="tan(phi) / k of Table 1")
    sets = [measured(TABLE_1, FORMS[0], seed) for seed in range(repeats)]
    fits = [identify(one, TABLE_1, FREE, search=Search(starts=1)).soil for one in sets]
    axis.plot([1000 * fit.k for fit in fits], [fit.phi * DEG for fit in fits], "r.", ms=3, label="fits of repeats")
    axis.plot(1000 * TABLE_1.k, TABLE_1.phi * DEG, "kx", ms=10, mew=2, label="truth")
    axis.set(xscale="log", xlim=(2, 2000), ylim=(3, 60.5), xlabel="k [mm]", ylabel="phi [deg]")
    axis.set_title("The valley: only tan(phi) / k is visible")
    axis.legend(loc="upper left")


def draw_profiles(axis: Axes) -> None:
    for soil, colour in ((TABLE_1, "tab:blue"), (SHORT, "tab:orange")):
        points = measured(soil, FORMS[0], seed=1)
        share = np.geomspace(0.1, min(20, 0.5 / soil.k), 61)  # k ends at half a metre
        chi2 = profile(points, soil, FREE, "k", soil.k * share)
        axis.plot(share, chi2 - chi2.min(), color=colour, label=f"true k = {1000 * soil.k:.0f} mm")
    axis.axhline(3.84, color="grey", ls="--", lw=1, label="95 %")
    axis.set(xscale="log", ylim=(0, 15), xlabel="k / true k [-]", ylabel="rise of chi2, phi refitted")
    axis.set_title("Profile likelihood of k (right wall of 50 mm: phi on its bound of 60 deg)", fontsize=10)
    axis.legend(loc="center right")


def draw_ratio(axis: Axes, repeats: int) -> None:
    """95 % intervals of k in repeated experiments: what an honest error bar on Table 1 looks like."""
    for at, (soil, colour) in enumerate(((TABLE_1, "tab:blue"), (SHORT, "tab:orange"))):
        for seed in range(min(repeats, 40)):
            fit = identify(measured(soil, FORMS[0], seed), soil, FREE, search=Search(starts=1))
            ends = [1000 * fit["k"].low, 1000 * fit["k"].high]
            axis.plot(ends, [seed + 45 * at] * 2, color=colour, lw=1)
        axis.axvline(1000 * soil.k, color=colour, ls=":", label=f"true k = {1000 * soil.k:.0f} mm")
    axis.set(xscale="log", xlabel="95 % interval of k [mm]", ylabel="experiment", yticks=[])
    axis.set_title("The same experiment, repeated")
    axis.legend()


if __name__ == "__main__":
    main()
