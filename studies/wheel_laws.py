"""Laws of slip, skid, side force and lugs side by side on seven measured sets of one sand, levels and sets held out.

Question
    Which of the forms that the literature has, or that are near at hand, do measured wheels follow? Does any predict a
    level or a set that was not fitted better than a curve through the points?
Method
    One sand and test bed (CMU): smooth wheel driving, braked, at slip angles and braked at them; wheel with 5 mm lugs
    driving, braked and at slip angles. k, phi, k_1 and the exit ratio (prior 0.143 +- 0.1) are fitted together with
    each law's own size, the exponent n = 1.52 is from pressing the smooth wheel in; errors are of each level predicted
    by a fit to the others. Beside them the mean, a quadratic in slip (and slip angle), and a Gaussian process of both,
    held out alike. "Both signs" is the driving and the braked smooth wheel with one soil. The lugged wheel is also
    predicted from the smooth one: all its numbers, the lugs' height with full pockets, and their grip by `LugGrip`, or
    sand that shears on sand: phi is the declared angle of repose, 29 deg, or by the smooth rim's grip over m = 0.7,
    `InterfaceFriction`'s default (Potyondy's ratios). "One sand" fits all sets together, each level of each predicted
    from all the others; "from the others" predicts a set from one soil fitted to the other six, without its runs.
Result
    Held out, drawbar pull / sinkage (/ side force), with quadratic and Gaussian process in brackets:
    smooth: softening 0.55 N / 1.03 mm, with rate 0.32 / 1.03 (1.39 / 1.65; 1.26 / 0.74); Ding's exponent of h / b 0.41
    / 1.29, of h in metres 0.56 / 2.18, exponential 0.66 / 2.58, Lyasko with a free power 0.66 / 2.60, base 0.63 / 5.90.
    braked: ploughing 0.58 / 1.53 (0.25 / 1.71; 1.21 / 5.90), a_b = 0.98 where volume says 1; exp(-a S^2) 1.82 / 3.19,
    exp(a S) 2.47 / 2.76, Ding in metres 2.80 / 3.74, the exponent of h / b 3.45 / 4.38 at its bound, base 2.55 / 10.6.
    both signs: softening with ploughing 0.88 / 1.34 (1.59 / 4.49; 2.80 / 1.47), exponents 3.66 / 3.56, base 3.0 / 6.6.
    lugged: softening, trench and rate 0.47 / 1.52 (1.82 / 2.78; 2.00 / 3.15), without rate 1.32 / 1.47, without trench
    1.45 / 7.0; base 1.27 / 12.3. The trench is that of 5.9 mm lugs with full pockets; they are 5 mm high, its prior.
    braked lugs: ploughing 0.67 / 1.93 (0.97 / 3.17; 3.09 / 6.41): the smooth wheel's pull within 0.6 N at each level.
    slip angles: softening and flank 0.78 / 1.15 / 0.54 (0.89 / 1.52 / 0.53; 0.85 / 1.29 / 0.59), with rate 0.56 / 1.15
    / 0.65, without softening 1.08 / 5.18 / 1.07, without flank 0.95 / 1.16 / 2.49.
    braked askew: softening, flank and ploughing 0.93 / 2.00 / 1.81 (0.61 / 1.95 / 0.66; 0.67 / 0.73 / 1.00).
    lugs askew: softening, flank, trench and grip 0.69 / 1.19 / 0.74 (1.04 / 2.03 / 0.75; 0.66 / 1.52 / 0.73).
    lugged from smooth: 2.14 N / 8.3 mm without lugs, 2.14 / 2.1 with their trench, 0.44 / 1.95 with their grip as well
    (learnt of it; by m = 0.7 0.94 / 1.92). Sand as in its heap asks too much of the pull, 4.38 / 1.7.
    One sand: softening, ploughing, flank, trench and grip bring every set to 0.60 to 2.15 N, 0.85 to 1.53 mm and 0.87
    to 2.14 N; a smooth rim that slides (m) instead of the grip leaves braked lugs at 4.3 N: braked, lugs do not matter.
    From the others: 0.67, 0.75, 0.85, 0.87, 1.59, 2.05 and 2.16 N; 0.94 to 2.00 mm; 0.89, 1.16 and 1.85 N sideways: in
    the median set, and twice that in every one, as was to be reached. The Gaussian process is ahead in pull where a set
    has its like among the others (smooth, lugged, both braked ones), and 2 to 11 mm, 2 to 6 N off where it has not.
    Not reached: the side force of all three sets askew, by 0.04, 0.14 and 1.0 N; braked askew and braked lugs in
    sinkage, by 0.5 and 0.4 mm; the pull braked askew, by 0.03 N, and at slip angles, without rate by 0.18 N. Braked
    askew, the side force is too large at r omega / V = 0.3 for 15 and 30 deg (by 2 to 3 N), too small for 45 deg at 0.5
    and 0.8 (by 2 N): the flank grows with depth as h^2.5, the measured one less. Straight skids pull 1 to 2 N less than
    one soil says. Over all channels in their noise the law is ahead of both curves on all sets but braked askew.
What the paper says
    "the digging and sinking process is not modeled in the simulation" (section 4.2); it has no side force.
What differs
    The forms of all laws, and kappa, d, k_f, l, e_b and h_g, were chosen with these seven sets in sight, so "held out"
    is of levels and sets, not of wheels or sands: read the comparison of forms, and wait for another bed. Travel speed
    is 10 mm/s throughout, so rim speed and slip go together: what RateDependence takes may be an effect of large slip.
    gamma is the declared density's.

Run: python studies/wheel_laws.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from forms.authors import AUTHORS, authors_errors
from forms.curves import BASELINES, carried_over, left_out
from forms.error_bars import draw_error_bars, last_law
from forms.joined import joined
from forms.laws import GRIP, LAW, LAWS, LUGS, ONE_SAND, RATE, RIM, SOFT, Laws
from forms.one_soil import APART, FROM, ONE, THE_LAW, from_the_others, one_sand, pressings_apart

from rover_pin.discrepancy.calibration import calibrated
from rover_pin.discrepancy.cross_validation import held_out_residual
from rover_pin.effects.effect import Effect
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.wheel_rig.candidates import numbers_of
from rover_pin.experiments.wheel_rig.data import RigSet, read_rig_set
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel
from rover_pin.plot import save, write_csv

DATA = Path(__file__).parent / "data"
REPOSE = np.radians(29.0)
"""Of studies/data/cmu-grousered-wheel/rig.toml [rad]."""
REACH = {
    "smooth": (0.41, 1.3, None), "lugged": (0.6, 2.5, None), "braked": (2.0, 2.0, None),
    "both signs": (1.5, 2.5, None), "slip angles": (0.6, 1.3, 0.5), "braked askew": (0.9, 1.5, 0.8),
    "lugs askew": (0.7, 1.4, 0.6), "braked lugs": (0.8, 1.5, None), "lugged from smooth": (1.2, 4.0, None),
}  # fmt: skip
"""Errors to reach: drawbar pull [N], sinkage [mm], side force [N]; DP/W = 0.05 is 1.2 N under the lugged wheel."""
EACH = (1.2, 2.5, 1.5)
"""To reach in the median set that is predicted from the others; twice that in every one."""

FOLDERS = {
    "smooth": "smooth-wheel", "braked": "smooth-wheel-skid", "slip angles": "smooth-wheel-angles",
    "lugged": "grousered-wheel", "braked askew": "smooth-wheel-angles-braked", "lugs askew": "grousered-wheel-angles",
    "braked lugs": "grousered-wheel-skid",
}  # fmt: skip


class Row(NamedTuple):
    """Held-out RMSE of one law on one set, and the number of sizes fitted beside the soil."""

    set: str
    law: str
    drawbar_pull_N: float
    sinkage_mm: float
    side_force_N: float
    in_sds: float
    "of all channels together, each in its noise"
    sizes: str = ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the first and the last law on the smooth wheel")
    parser.add_argument("--out", type=Path, default=Path("out/wheel_laws"))
    asked = parser.parse_args()
    rows = table(asked.quick)
    frame = pd.DataFrame(rows)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_csv(frame, asked.out / "wheel_laws.csv")
    print(shown(frame))
    save(draw_error_bars(frame), asked.out / "wheel_laws.png")
    print(f"written: {asked.out / 'wheel_laws.csv'}, {asked.out / 'wheel_laws.png'}")


def shown(frame: pd.DataFrame) -> str:
    """Return the table for a reader, with what was to be reached under each set."""
    lines = ["Held-out RMSE by level: drawbar pull [N], sinkage [mm], side force [N], all channels in their noise"]
    for name, rows in frame.groupby("set", sort=False):
        reach = EACH if FROM in str(name) else REACH[str(name).removeprefix(APART).removeprefix(ONE)]
        lines.append(f"\n{name}; reach {reach}")
        for row in rows.itertuples():
            side = "" if np.isnan(row.side_force_N) else f"{row.side_force_N:7.2f}"
            errors = f"{row.drawbar_pull_N:6.2f} {row.sinkage_mm:6.2f}{side:8} {row.in_sds:5.1f} SD"
            lines.append(f"  {row.law:36} {errors} {row.sizes}")
    if set(REACH) <= set(frame["set"]):
        lines += ["", *side_by_side(frame)]
        lines.append(f"\nahead of both curves over all channels, each in its noise: {', '.join(ahead(frame))}")
    return "\n".join(lines)


def side_by_side(frame: pd.DataFrame) -> list[str]:
    """Return the errors of each set as one line: by its own law, by one soil, from the others, and by rivals."""
    errors = frame.set_index(["set", "law"])[["drawbar_pull_N", "sinkage_mm", "side_force_N"]]
    table = pd.DataFrame(
        {
            "own law": cell(errors.loc[name, last_law(errors.loc[name])]),
            "one soil": cell(errors.loc[ONE + name, LAW]),
            "from the others": cell(errors.loc[FROM + name, THE_LAW]),
            **{rival: cell(errors.loc[name, rival]) for rival in ("Gaussian process", AUTHORS)},
            "reach": cell(REACH[name]),
        }
        for name in FOLDERS
    )
    alone = errors.loc[[(FROM + name, THE_LAW) for name in FOLDERS]]
    return [
        table.set_index(pd.Index(FOLDERS)).to_string(),
        f"from the others, median: {cell(alone.median())}; reach {cell(EACH)}",
        f"from the others, worst: {cell(alone.max())}; reach {cell(2 * each for each in EACH)}",
    ]


def cell(errors: Iterable[float | None]) -> str:
    """Return errors with slashes, those that there are."""
    return " / ".join(f"{error:.2f}" for error in errors if error is not None and not math.isnan(error))


def ahead(frame: pd.DataFrame) -> list[str]:
    """Return the sets on which the last law beats both curves over all channels, each in its noise."""
    found = []
    for name in REACH:
        errors = frame[frame["set"] == name].set_index("law")["in_sds"]
        found += [name] if errors[last_law(errors)] < min(errors["quadratic"], errors["Gaussian process"]) else []
    return found


def table(quick: bool = False) -> list[Row]:
    """Return the errors of all laws and baselines on all sets."""
    sets = {name: read_rig_set(DATA / f"cmu-{folder}") for name, folder in FOLDERS.items()}
    smooth, braked = sets["smooth"], sets["braked"]
    n = float(smooth.soil().n)
    if quick:
        return compared("smooth", smooth, {name: LAWS["smooth"][name] for name in ("base", "softening")}, n)
    both = {"both signs": joined(smooth, braked.rows(np.asarray(braked.rig.slip) < -0.1))}
    rows = [row for name, laws in LAWS.items() for row in compared(name, (sets | both)[name], laws, n)]
    law = ONE_SAND[LAW]
    soil = (*one_sand(sets, ONE_SAND), *from_the_others(sets, law), *pressings_apart(sets, law, LAW))
    return [*rows, *from_smooth(smooth, sets["lugged"], n), *(Row(*cells) for cells in soil)]


def compared(name: str, data: RigSet, laws: Laws, n: float) -> list[Row]:
    """Return one row a law and a baseline."""
    experiment, rows = RigExperiment(data), []
    for law, effects in laws.items():
        fit = fitted(data, effects, n)
        rows.append(row(name, law, data, experiment.rows(held_out_residual(fit)), sizes(fit)))
    curves = [row(name, law, data, left_out(data, predict)) for law, predict in BASELINES.items()]
    return [*rows, *curves, row(name, AUTHORS, data, authors_errors(data))]


def fitted(data: RigSet, effects: tuple[Effect, ...], n: float) -> Fit:
    """Return soil and sizes fitted to all levels."""
    soil = data.soil()
    soil = soil.replace(c=0.0, n=n, k_1=soil.k_1 if data.trials else 1e5)
    model = RigModel(data.rig.wheel, soil, (*(ASKEW if data.rig.askew.any() else PAPER), *effects))
    experiment = RigExperiment(data)
    return calibrated(experiment, model, numbers_of(experiment, model))


def sizes(fit: Fit) -> str:
    """Return what was fitted, in words."""
    return ", ".join(f"{one.name} = {fit.value(one.name):.3g}" for one in fit.parameters)


def row(name: str, law: str, data: RigSet, error: np.ndarray, said: str = "") -> Row:
    """Return the RMSE of errors [channels, runs] as a row."""
    channels = data.rig.channels
    rms = dict(zip((channel.column for channel in channels), np.sqrt(np.mean(error**2, axis=1)), strict=True))
    noise = float(np.sqrt(np.mean((error / np.array([channel.sd for channel in channels])) ** 2)))
    return Row(name, law, rms["drawbar_pull_N"], 1e3 * rms["sinkage_m"], rms.get("lateral_N", np.nan), noise, said)


def from_smooth(smooth: RigSet, lugged: RigSet, n: float) -> list[Row]:
    """Predict the lugged wheel from the smooth one, with its lugs' geometry and without."""
    model = fitted(smooth, (SOFT, RATE), n).model
    heap, sand = (
        dataclasses.replace(model, soil=model.soil.replace(phi=phi))
        for phi in (REPOSE, math.atan(math.tan(model.soil.phi) / RIM.m))
    )
    rows = []
    for law, one in (
        ("without lugs", model),
        ("lugs, the smooth rim's grip", model.having(LUGS)),
        ("lugs, sand as in its heap", heap.having(LUGS)),
        ("lugs and their grip", model.having(LUGS).having(GRIP)),
        ("lugs, sand on sand by the rim's m", sand.having(LUGS)),
    ):
        found = one.predict(lugged.rig.load, lugged.rig.slip, lugged.speeds)
        values = {"drawbar_pull_N": found.drawbar_pull, "sinkage_m": found.sinkage}
        error = np.array([values[channel.column] - channel.measured for channel in lugged.rig.channels])
        rows.append(row("lugged from smooth", law, lugged, error))
    curves = {law: carried_over(smooth, lugged, predict) for law, predict in BASELINES.items()}
    return rows + [row("lugged from smooth", law, lugged, error) for law, error in curves.items()]


if __name__ == "__main__":
    main()
