"""Keep how long the commands take that README and the page of the command line show.

Question
    How long does each main command take?
Method
    Each runs as printed in one folder, what it needs before it; the second time where the first compiles.
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
PAGES = (ROOT / "README.md", ROOT / "docs" / "command-line.md")
EXAMPLE = re.compile(r"^(?:\| [^|]*\| `)?(rover-pin [^`\n]+?)(?: --open)?(?:`.*)?$", re.MULTILINE)
"""A command of a block or of a table's row, without what opens a browser."""


def main() -> None:
    """Run every command and write the table."""
    os.environ["BROWSER"] = "true"  # opens nothing
    sys.path.insert(0, str(ROOT))
    from tests.test_commands_of_pages import NEEDS

    commands = dict.fromkeys(line for page in PAGES for line in EXAMPLE.findall(page.read_text(encoding="utf-8")))
    rows, done = [], set()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", folder / "mine.csv")
        copyfile(ROOT / "urdf" / "cart.urdf", folder / "my_rover.urdf")
        for link in ("studies", "urdf"):
            (folder / link).symlink_to(ROOT / link)
        run("rover-pin drive ditch --gravity moon --control eq9", folder)  # compiles
        for command in commands:
            for needed in NEEDS.get(command, ()):
                if needed not in done:
                    run(needed, folder)
                    done.add(needed)
            before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            run(command, folder)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            done.add(command)
            cpu = sum(getattr(after, part) - getattr(before, part) for part in ("ru_utime", "ru_stime"))
            rows.append((command, round(time.perf_counter() - clock, 1), round(cpu, 1), os.cpu_count()))
            print(*rows[-1], flush=True)
    pd.DataFrame(rows, columns=["command", "clock_s", "cpu_s", "cores"]).to_csv(KEPT, index=False)


if __name__ == "__main__":
    main()
