"""The gallery: every ready-made scenario, driven as it comes or as its page says, with the pictures of `docs/`.

Question
    What does each scenario look like, and what becomes of the rover in it?
Method
    Drive the scenarios of `rover-pin list scenarios` but the two that want a file of your own (`polyline`, `grid`), at
    their settings; those whose picture stands in `docs/gallery.md` with the settings that stand above it.
Result
    On slope-sand all are passed, or still climbed when the drive ends; on the paper's sand (Table 1) the ditch, the
    step and the upper end of the growing slope hold the rover. One-sided ground turns a rover that nobody steers: the
    rocks by 11 deg in 30 s. `docs/gallery.md` has a line for each.
What the paper says
    Sections 4 and 5 drive a flat, a slope, a bump and a ditch; the test field of section 4 has rocks besides.
What differs
    Sizes of bump, ditch and rocks are not in the paper: they are assumed, and so is where the rover ends.

Run: python studies/gallery.py [--quick] [--out DIR]; the page has its pictures and studies/results its gallery.csv
"""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

import pandas as pd

from rover_pin.plot import save, snapshots, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.scenarios.scenes import SCENES

WANT_A_FILE = ("polyline", "grid")
PICTURES = {
    "ditch.png": "ditch --set duration=30",
    "field.png": "field",
    "slope.png": "slope",
    "bump.png": "one-sided-bump",
    "washboard.png": "washboard",
    "rocks.png": "rocks --set duration=24",
    "turn.png": "turn",
    "hills.png": "hills --set rover=cart --set terrain.height=15cm --set duration=12",
}
"""Pictures of the page, and what `rover-pin drive` is given for them."""


def main() -> None:
    """Compute, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the first second of every drive")
    parser.add_argument("--out", type=Path, default=Path("out/gallery"))
    options = parser.parse_args()
    more = {"duration": 1.0} if options.quick else {}
    words = [*PICTURES.values(), *(name for name in SCENES if name not in WANT_A_FILE)]
    rows = []
    for each in dict.fromkeys(words):
        made = drive_of(each, **more)
        trace = made.drive()
        rows.append((f"rover-pin drive {each}", trace.attrs["outcome"], float(trace.t[-1])))
        for file in [file for file, given in PICTURES.items() if given == each]:
            save(snapshots(trace, made.model), options.out / file)
    table = pd.DataFrame(rows, columns=["command", "outcome", "time [s]"])
    write_csv(table[["command", "outcome"]], options.out / "gallery.csv")
    print(table.to_string(index=False))


def drive_of(words: str, **more: float) -> Scenario:
    """Return the drive of a command's words: a scenario, and `--set`s."""
    name, *others = shlex.split(words)
    settings = dict(word.split("=", 1) for word in others if word != "--set")
    return scenario(name, **{**settings, **more})


if __name__ == "__main__":
    main()
