"""The gallery: drive every ready-made scenario, at its defaults or with its page's settings, and draw it for `docs/`.

Question
    What does each scenario look like, and what happens to the rover in it?
Method
    Drive the scenarios of `rover-pin list scenarios`, except the two that need a user's file (`polyline`, `grid`), at
    their defaults. Scenarios with a picture in `docs/gallery.md` are driven with the settings above the picture.
Result
    On slope-sand the rover passes all scenarios, or still climbs when the drive ends. On the paper's sand (Table 1) the
    ditch, the step and the upper end of the growing slope stop the rover. One-sided ground turns a rover that is not
    steered: the rocks by 11 deg in 30 s. `docs/gallery.md` has a line for each scenario.
What the paper says
    Sections 4 and 5 drive a flat, a slope, a bump and a ditch; the test field of section 4 also has rocks.
What differs
    Sizes of bump, ditch and rocks are not in the paper. They are assumed, so the final positions are assumed as well.

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
"""Pictures of the page -> arguments of `rover-pin drive`."""


def main() -> None:
    """Drive every scenario, save the pictures, and write and print the outcomes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the first second of every drive")
    parser.add_argument("--out", type=Path, default=Path("out/gallery"))
    options = parser.parse_args()
    more = {"duration": 1.0} if options.quick else {}
    # A scenario with a picture and the same scenario at its defaults count as two drives.
    words = [*PICTURES.values(), *(name for name in SCENES if name not in WANT_A_FILE)]
    rows = []
    for arguments in dict.fromkeys(words):
        case = drive_of(arguments, **more)
        trace = case.drive()
        rows.append((f"rover-pin drive {arguments}", trace.attrs["outcome"], float(trace.t[-1])))
        # A drive may serve no picture or several.
        for file in [file for file, words_of_picture in PICTURES.items() if words_of_picture == arguments]:
            save(snapshots(trace, case.model), options.out / file)
    table = pd.DataFrame(rows, columns=["command", "outcome", "time [s]"])
    write_csv(table[["command", "outcome"]], options.out / "gallery.csv")
    print(table.to_string(index=False))


def drive_of(words: str, **more: float) -> Scenario:
    """Return the drive for the words of a command: a scenario, and `--set` options."""
    name, *others = shlex.split(words)
    settings = dict(word.split("=", 1) for word in others if word != "--set")
    return scenario(name, **{**settings, **more})


if __name__ == "__main__":
    main()
