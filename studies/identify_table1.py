"""Do the points of Fig 6 determine Table 1's k and phi?

Question
    Section 4.1 reads phi = 30 deg and k = 0.05 m from scattered traction factors. How well do such points determine k
    and phi?
Method
    Scattered single measurements are drawn from Table 1 itself, so the truth is known: 11 slips from 0 to 1, 5 repeats,
    scatter 0.067 (assumed), which gives means with an SD of 0.03. `identify` fits k and phi with all other constants
    fixed, and once with the other constants as uncertain as they are without a measurement. The experiment is repeated
    with fresh scatter, for smaller k, and with the traction factor T / (r f_n) (wheel torque T, radius r, normal force
    f_n) instead of drawbar pull / f_n.
Result
    See studies/results/commands.toml, `table_1`, and the printed table. For k = 50 mm neither k nor phi is
    identifiable: only tan(phi) / k is. k = 5 mm would be identifiable, 20 mm is not.
What the paper says
    "The data plots are relatively scattered, then mean values at each slip ratio are depicted with an error bar
    indicating +-1SD"; "the specific parameters are used [...] as listed in Table 1".
What differs
    The paper states no uncertainty. Where j / k stays small, the shear stress is sigma tan(phi) j / k, and the points
    depend on the ratio tan(phi) / k only. r = 45 mm with k = 50 mm is such a case. Fig 6's own points are not published
    as numbers.

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
from rover_pin.discrepancy.experiment import Parts
from rover_pin.estimation.identification import Identification
from rover_pin.experiments.traction_factors import TractionFactors
from rover_pin.loop.identify import identify
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.parameters import NEXUS6_WHEEL, TABLE_1
from rover_pin.soil.wheel_forces import NetTraction, TorqueTraction, TractionForm, load_traction_factor

SLIPS, REPEATS, SCATTER = np.linspace(0, 1, 11), 5, 0.067
FORMS = (NetTraction(), TorqueTraction())
K_MM = (2, 5, 10, 20, 50)
DEG = math.degrees(1.0)
SHORT = TABLE_1.replace(k=0.005)
HELD = {name: float(getattr(TABLE_1, name)) for name in ("c", "n", "k_1", "theta_1", "theta_2")}
HELD |= {name: float(getattr(NEXUS6_WHEEL, name)) for name in ("r", "b")}


def main() -> None:
    """Repeat the experiment for every k and form, print the table and one full identification, and draw the figure."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="fewer repeated experiments and a coarser map")
    options.add_argument("--out", type=Path, default=Path("out"))
    parsed = options.parse_args()
    parsed.out.mkdir(parents=True, exist_ok=True)
    repeats, cells = (5, 25) if parsed.quick else (100, 70)

    # Every form with every k, from identifiable to not identifiable.
    table = pd.DataFrame([row(K / 1000, form, repeats) for form in FORMS for K in K_MM])
    table.to_csv(parsed.out / "identify_table1.csv", index=False)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    # A single experiment like the paper's, with all constants uncertain.
    points = measured(TABLE_1, FORMS[0], seed=1)
    print(f"\nTable 1, net form, one experiment, all constants uncertain:\n{identify(points).report()}")
    draw(points, repeats, cells).savefig(parsed.out / "identify_table1.png", dpi=150)


def measured(soil: Soil, form: TractionForm, seed: int) -> TractionFactors:
    """Return means of scattered single measurements of a known soil, as the paper describes its own."""
    noise = np.random.default_rng(seed).normal(0, SCATTER, (len(SLIPS), REPEATS))
    scattered = factors(SLIPS, soil, form)[:, None] + noise
    sd = np.sqrt(scattered.var(axis=1, ddof=1).mean() / REPEATS)  # pooled: that of a handful is uncertain itself
    return bench(TractionPoints(SLIPS, scattered.mean(axis=1), sd, NEXUS6_WHEEL, form))


def bench(points: TractionPoints) -> TractionFactors:
    """Return the experiment that `identify` takes, with Table 1 as the initial soil."""
    return TractionFactors(points, Parts({"soil": TABLE_1, "wheel": NEXUS6_WHEEL}))


def factors(slips: np.ndarray, soil: Soil, form: TractionForm = FORMS[0]) -> np.ndarray:
    """Return the traction factor F at each slip."""
    return np.array([float(load_traction_factor(float(S), soil, NEXUS6_WHEEL, form)) for S in slips])


def row(k: float, form: TractionForm, repeats: int) -> dict[str, float | str]:
    """Return a row of the table for one true k: the result of the identification from points without noise, and the
    share of repeated experiments whose interval contains the truth.
    """
    soil = TABLE_1.replace(k=k)
    clean = TractionPoints(SLIPS, factors(SLIPS, soil, form), SCATTER / math.sqrt(REPEATS), form=form)
    ideal = identify(bench(clean), fixed=HELD)
    fits = [identify(measured(soil, form, seed), fixed=HELD) for seed in range(repeats)]
    k_row, phi_row = ideal["k"].number, ideal["phi"].number
    # Coverage: the share of repeated experiments whose 95 % interval contains the truth.
    holds = {name: np.mean([held(fit, name, float(getattr(soil, name))) for fit in fits]) for name in ("k", "phi")}
    return {
        "form": form.name,
        "k_mm": 1000 * k,
        "k_low_mm": 1000 * k_row.low,
        "k_high_mm": 1000 * k_row.high,
        "phi_low_deg": phi_row.low * DEG,
        "phi_high_deg": phi_row.high * DEG,
        "correlation": abs(ideal.correlation[0, 1]),
        "found": " ".join(name.partition(".")[2] for name in ideal.found) or "none",
        "k_95_holds_truth": holds["k"],
        "phi_95_holds_truth": holds["phi"],
    }


def held(fit: Identification, name: str, truth: float) -> bool:
    """Return whether the 95 % interval of a number contains the truth."""
    number = fit[name].number
    return number.low <= truth <= number.high


def draw(points: TractionFactors, repeats: int, cells: int) -> plt.Figure:
    """Draw one experiment, the valley of chi2, and the intervals of repeated experiments."""
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
    draw_points(axes[0], points)
    draw_valley(axes[1], points, cells)
    draw_intervals(axes[2], repeats)
    figure.suptitle("What the points of Fig 6 tell of k and phi (data drawn from Table 1 itself, SD of a mean 0.03)")
    return figure


def draw_points(axis: Axes, bench_: TractionFactors) -> None:
    """Draw the points of one experiment, with three soils of equal tan(phi) / k that the eye cannot distinguish."""
    points, fine, ratio = bench_.points, np.linspace(0, 1, 60), math.tan(float(TABLE_1.phi)) / float(TABLE_1.k)
    axis.errorbar(points.slip, points.factor, points.sd, fmt="ko", capsize=3, label="means +-1 SD of the mean")
    for k, style in ((0.02, "--"), (0.05, "-"), (0.1, ":")):
        # Another k with the phi that keeps tan(phi) / k.
        soil = TABLE_1.replace(k=k, phi=math.atan(ratio * k))
        axis.plot(fine, factors(fine, soil), style, label=f"k = {1000 * k:.0f} mm, phi = {soil.phi * DEG:.0f} deg")
    axis.set(xlabel="slip ratio S [-]", ylabel="F = f_t / f_n [-]", title="One experiment at Table 1")
    axis.legend(loc="lower right")


def draw_valley(axis: Axes, bench_: TractionFactors, cells: int) -> None:
    """Draw chi2 over (k, phi), with the line of constant tan(phi) / k."""
    k, phi = np.geomspace(0.002, 0.5, cells), np.linspace(3, 60, cells)
    model, noise = bench_.base_model(), bench_.noise()
    models = [bench_.with_values(model, {"soil.k": float(x), "soil.phi": float(y) / DEG}) for y in phi for x in k]
    # Residuals in units of the noise, summed over the points for every cell of the map.
    rows = noise.white(bench_.observed - bench_.predict(models))
    chi2 = np.sum(rows**2, axis=-1).reshape(cells, cells)
    levels = [0, 1, 3.84, 5.99, 10, 20, 30]
    filled = axis.contourf(1000 * k, phi, np.minimum(chi2 - chi2.min(), 30), levels=levels, cmap="viridis_r")
    axis.figure.colorbar(filled, ax=axis, label="rise of chi2 (shown to 30)")
    ratio = math.tan(float(TABLE_1.phi)) / float(TABLE_1.k)
    axis.plot(1000 * k, np.degrees(np.arctan(ratio * k)), "w--", label="tan(phi) / k of Table 1")
    axis.plot(1000 * TABLE_1.k, TABLE_1.phi * DEG, "kx", ms=10, mew=2, label="truth")
    axis.set(xscale="log", ylim=(3, 60), xlabel="k [mm]", ylabel="phi [deg]")
    axis.set_title("The valley: only tan(phi) / k is visible")
    axis.legend(loc="upper left")


def draw_intervals(axis: Axes, repeats: int) -> None:
    """Draw the 95 % intervals of k in repeated experiments, for Table 1 and for a smaller k."""
    for at, (soil, colour) in enumerate(((TABLE_1, "tab:blue"), (SHORT, "tab:orange"))):
        # Forty intervals are enough for the figure.
        for seed in range(min(repeats, 40)):
            number = identify(measured(soil, FORMS[0], seed), fixed=HELD)["k"].number
            axis.plot([1000 * number.low, 1000 * number.high], [seed + 45 * at] * 2, color=colour, lw=1)
        axis.axvline(1000 * soil.k, color=colour, ls=":", label=f"true k = {1000 * soil.k:.0f} mm")
    axis.set(xscale="log", xlabel="95 % interval of k [mm]", ylabel="experiment", yticks=[])
    axis.set_title("The same experiment, repeated")
    axis.legend()


if __name__ == "__main__":
    main()
