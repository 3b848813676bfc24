"""What three measured wheels tell of the soil's constants.

Question
    Which constants of Eqs (2)-(5) do the shipped wheel-rig sets tell, and do they agree with what is known otherwise?
Method
    `identify` with theta_1 from the load and c as declared. Smooth wheel on dry sand: c = 0 and n held at 1.46, the
    slope of pressing the same wheel in without turning; once more with r and b free inside the two public sources'
    disagreement. Ding's wheels: n held at the declared 1.1; drawbar pull alone, then with torque and sinkage; without
    the row at slip 0, whose torque 0 is digitised and not physical.
Result
    Smooth wheel: phi 15.3 deg (12.6 to 19.3) and k_1 49 kPa (42 to 58) are found; k is below 14 mm and no more; with n
    free too, n lies anywhere in 0.2 to 3 and k_1 between 9 and 404 kPa. RMSE 0.35 N and 4.5 mm: the drawbar pull is met
    within its noise, the sinkage misses by 7.5 times its noise (it grows with slip, the law's does not), so all SDs are
    widened 5.6 times. r and b stay at their range's middle and move phi by 0.3 deg, k_1 by 2 %. phi is far from the
    29 deg of repose: the smooth rim seems to slide on the sand.
    Ding: drawbar pull alone fits within 0.2 to 0.4 N and "finds" phi 14.8 and 21.3 deg with k 2.2 and 3.7 mm, against
    31.9 deg and 9.7 to 13.1 mm measured otherwise; with torque and sinkage the same law misses by 12 and 21 SDs. One
    channel hides what the model lacks: judge a fit on all channels.
What the paper says
    Section 3.2 gives the law; section 4.1 fits one curve of F(S) and prints no uncertainty.
What differs
    Loads, wheels and sands are others' than the paper's.

Run: python studies/identify_rigs.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from rover_pin.contact import Soil
from rover_pin.estimation.problem import Prior
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.result import Identification
from rover_pin.measurements.channel import DrawbarPull, RigChannel
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig

DATA = Path(__file__).parent / "data"
PRESSED_N = 1.46
COLOURS = ("tab:blue", "tab:orange", "tab:green")


class Case(NamedTuple):
    """One fit."""

    label: str
    data: WheelRig
    soil: Soil
    free: tuple[str, ...]
    priors: dict[str, Prior]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="fewer starts")
    options.add_argument("--out", type=Path, default=Path("out"))
    asked = options.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    search = Search(starts=2 if asked.quick else 8)
    done = [(case, identify(*case[1:4], case.priors, search)) for case in cases()]
    for case, result in done:
        print(f"{case.label}\n{result.report()}\n")
    table = pd.DataFrame([row for case, result in done for row in rows(case, result)])
    table.to_csv(asked.out / "identify_rigs.csv", index=False)
    draw(done).savefig(asked.out / "identify_rigs.png", dpi=150)


def cases() -> list[Case]:
    smooth = read_wheel_rig(DATA / "cmu-smooth-wheel")
    pressed = Soil(c=0.0, k=0.005, n=PRESSED_N)
    ranges = smooth.wheel_range.items()
    uncertain = {name: Prior((low + high) / 2, (high - low) / math.sqrt(12)) for name, (low, high) in ranges}
    found = [
        Case("smooth wheel", smooth, pressed, ("k", "phi", "k_1"), {}),
        Case("smooth wheel, r and b uncertain", smooth, pressed, ("k", "phi", "k_1", "r", "b"), uncertain),
        Case("smooth wheel, n free", smooth, pressed, ("k", "phi", "k_1", "n"), {}),
    ]
    for name in ("smooth", "lugged"):
        driven = read_wheel_rig(DATA / f"ding-2011-{name}").rows(slice(1, None))
        soil = width_own(driven)
        found.append(Case(f"Ding {name}, drawbar pull only", driven.only(DrawbarPull), soil, ("k", "phi"), {}))
        found.append(Case(f"Ding {name}, all channels", driven, soil, ("k", "phi", "k_1"), {}))
    return found


def width_own(data: WheelRig) -> Soil:
    """Return the declared soil with all of k_1 + k_2 b in k_1: one width tells their sum only."""
    soil = data.declared_soil(Soil())
    return soil.replace(k_1=soil.k_1 + soil.k_2 * data.wheel.b, k_2=0.0)


def rows(case: Case, result: Identification) -> list[dict[str, object]]:
    fit = {f"rmse_{channel.name.replace(' ', '_')}": channel.rmse for channel in result.channels}
    return [
        {
            "case": case.label,
            "parameter": one.name,
            "best_fit": getattr(result.soil, one.name, math.nan),
            "sd": one.sd,
            "low": one.low,
            "high": one.high,
            "verdict": one.verdict.value,
            "chi2": result.chi2,
            "freedom": result.freedom,
            "misfit": result.misfit,
            **fit,
        }
        for one in result.estimates
    ]


def draw(done: list[tuple[Case, Identification]]) -> plt.Figure:
    figure, axes = plt.subplots(3, 3, figsize=(13, 10), layout="constrained")
    shown = [(case, result) for case, result in done if len(case.data.channels) > 1 and not case.priors]
    shown = [pair for pair in shown if "n" not in pair[0].free]
    for column, (case, result) in enumerate(shown):
        for row in range(3):
            axis = axes[row, column]
            if row < len(case.data.channels):
                draw_channel(axis, case, result, case.data.channels[row], COLOURS[row])
            else:
                axis.set_axis_off()
        axes[0, column].set_title(f"{case.label}:\n{summary(result)}", fontsize=10)
    figure.suptitle("Measured wheels (points, +-1 SD) and the best fit of Eqs (2)-(7) with theta_1 from the load")
    return figure


def draw_channel(axis: Axes, case: Case, result: Identification, channel: RigChannel, colour: str) -> None:
    order = np.argsort(case.data.slip)
    fields = {**case.data.wheel.values(), **result.soil.values()}
    predicted, _ = case.data.only(type(channel)).predictor(("k",))(np.array(list(fields.values())))
    axis.errorbar(case.data.slip, channel.measured, channel.sd, fmt="ko", ms=4, capsize=2)
    axis.plot(
        case.data.slip[order], predicted[order], "s:", mfc="none", color=colour, label="best fit at each run's load"
    )
    axis.legend(fontsize=8)
    axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name} [{channel.unit}]")


def summary(result: Identification) -> str:
    return "found " + (", ".join(result.identified) or "nothing") + f"; SDs widened {result.misfit:.1f} x"


if __name__ == "__main__":
    main()
