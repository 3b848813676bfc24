"""Keep how long the commands take that README shows and the page of the command line is made of.

Question
    How long does each command take?
Method
    Each of the kept table and of README runs as printed in one folder, what it needs before it; the second time where
    the first compiles.
Result
    `studies/results/times.csv`: seconds on the clock and of CPU, and how many cores there were.
What the paper says
    Nothing; these are times of this package.
What differs
    Other work on the machine lengthens the clock and hardly the CPU seconds.
"""

import os
import re
import resource
import sys
import tempfile
import time
from pathlib import Path
from shutil import copyfile

import pandas as pd
from keep_numbers import ROOT, run

KEPT = ROOT / "studies" / "results" / "times.csv"
README = ROOT / "README.md"
EXAMPLE = re.compile(r"^(rover-pin [^`\n]+?)(?: --open)?$", re.MULTILINE)
"""A command of a block, without what opens a browser."""


def main() -> None:
    """Run every command, or those that begin with the words that are given, and write the table."""
    os.environ["BROWSER"] = "true"  # opens nothing
    sys.path.insert(0, str(ROOT))
    from tests.test_commands_of_pages import NEEDS

    kept = pd.read_csv(KEPT, index_col="command").to_dict("index")
    shown = dict.fromkeys([*EXAMPLE.findall(README.read_text(encoding="utf-8")), *kept])
    commands = [command for command in shown if command.startswith(" ".join(["rover-pin", *sys.argv[1:]]))]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", folder / "mine.csv")
        copyfile(ROOT / "urdf" / "cart.urdf", folder / "my_rover.urdf")
        for link in ("studies", "urdf"):
            (folder / link).symlink_to(ROOT / link)
        run("rover-pin drive ditch --gravity moon --control eq9", folder)  # compiles
        for needed in dict.fromkeys(needed for command in commands for needed in NEEDS.get(command, ())):
            run(needed, folder)
        for command in commands:
            kept[command] = timed(command, folder)
            print(command, kept[command], flush=True)
    rows = {command: kept[command] for command in shown if command in kept}
    pd.DataFrame.from_dict(rows, orient="index").rename_axis("command").to_csv(KEPT)


def timed(command: str, folder: Path) -> dict[str, float]:
    """Return seconds on the clock and of CPU, its workers' too, and the number of cores."""
    before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    run(command, folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = sum(getattr(after, part) - getattr(before, part) for part in ("ru_utime", "ru_stime"))
    return {"clock_s": round(time.perf_counter() - clock, 1), "cpu_s": round(cpu, 1), "cores": os.cpu_count() or 1}


if __name__ == "__main__":
    main()
