"""What three measured wheels tell of the soil's constants.

Question
    Which constants of Eqs (2)-(5) do the shipped wheel-rig sets tell, and do they agree with what is known otherwise?
Method
    `identify`: the loop's fit of the base model, theta_1 from the load, constants as declared or assumed; Ding's wheels
    once with their pull alone. The row at slip 0 of these is left out, whose torque 0 is digitised and not physical.
Result
    Printed, and in identify_rigs.csv. The smooth wheel's phi depends on where the contact ends (exit ratio), which
    nobody measured, and is far from the 29 deg of repose: the smooth rim seems to slide on the sand. Ding's pull alone
    is met within its noise by soils that are not what was measured otherwise; with torque and sinkage the same law
    misses by many SDs. One channel hides what the model lacks: judge a fit on all channels.
What the paper says
    Section 3.2 gives the law; section 4.1 fits one curve of F(S) and prints no uncertainty.
What differs
    Loads, wheels and sands are others' than the paper's.

Run: python studies/identify_rigs.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from rover_pin.estimation.identification import Identification
from rover_pin.experiments.wheel_rig.data import RigSet, as_rig_set, read_rig_set
from rover_pin.loop.identify import identify
from rover_pin.measurements.channel import DrawbarPull
from rover_pin.measurements.wheel_rig import read_wheel_rig

DATA = Path(__file__).parent / "data"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="the same: it takes seconds")
    options.add_argument("--out", type=Path, default=Path("out"))
    asked = options.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    table, reports = [], []
    for label, data in cases():
        found = identify(data)
        reports.append(f"## {label}\n\n```text\n{found.report()}\n```\n")
        table += rows(label, found)
    print("\n".join(reports))
    (asked.out / "identify_rigs.md").write_text("\n".join(reports), encoding="utf-8")
    pd.DataFrame(table).to_csv(asked.out / "identify_rigs.csv", index=False)


def cases() -> Iterator[tuple[str, RigSet]]:
    yield "smooth wheel", read_rig_set(DATA / "cmu-smooth-wheel")
    for name in ("smooth", "lugged"):
        driven = read_wheel_rig(DATA / f"ding-2011-{name}").rows(slice(1, None))
        yield f"Ding {name}, drawbar pull only", as_rig_set(driven.only(DrawbarPull))
        yield f"Ding {name}, all channels", as_rig_set(driven)


def rows(label: str, found: Identification) -> list[dict[str, object]]:
    fit = {f"rmse_{channel.name.replace(' ', '_')}": channel.rmse for channel in found.channels}
    return [
        {
            "case": label,
            "parameter": estimate.number.name,
            "value": estimate.number.value,
            "low": estimate.number.low,
            "high": estimate.number.high,
            "found": estimate.is_found,
            "depends_on": " ".join(estimate.depends_on),
            "misfit": found.misfit,
            **fit,
        }
        for estimate in found.estimates
    ]


if __name__ == "__main__":
    main()
