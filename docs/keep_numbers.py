"""Keep what the commands of README and pages print: the numbers that the pages show.

Question
    Which numbers stand beside a command in README and docs/?
Method
    Each command runs as printed in a folder of its own; patterns pick its numbers from what it prints.
Result
    `studies/results/commands.toml`: a table of numbers for each command, put into the pages when they are built.
What the paper says
    Nothing; these are results of this package.
What differs
    Nothing.
"""

import argparse
import ast
import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "studies" / "results" / "commands.toml"
NUMBER = r"([-+]?[\d.]+(?:e[-+]?\d+)?)"
WORD = r"[-+.\de]+"
INTERVAL = rf"{NUMBER}[ \w]* \[{NUMBER}[ \w]*, {NUMBER}[ \w]*\]"
Patterns = dict[str, str]
"""What is printed, by the names of its groups, apart by a space; a number is kept as a number."""
SAG = {
    "R_b R_b_low R_b_high": rf"SupplySag.R_b = {INTERVAL}",
    "before after": rf"held-out battery_V: RMSE {NUMBER} V -> {NUMBER} V",
}
"""What a loop finds of a sagging supply: the errors of the bus voltage in volts, as it prints them."""

COMMANDS: dict[str, tuple[tuple[str, ...], Patterns]] = {
    "smooth_wheel": (("rover-pin close-loop cmu-smooth-wheel",), {
        "before after": rf"sinkage: RMSE {NUMBER} mm -> {NUMBER} mm",
        "n_1 n_1_low n_1_high": rf"SlipSinkage.n_1 = {INTERVAL}",
        "exponent softening": rf"SlipSinkage \({NUMBER}\) or SlipSoftening \({NUMBER}\)",
        "softened": rf"with SlipSoftening instead: [^;]+; held-out RMSE drawbar pull {WORD} N, sinkage {NUMBER} mm",
        "anew": rf"of all hypotheses together: drawbar pull {WORD} N, sinkage {NUMBER} mm",
        "pressing pressing_low pressing_high": rf"rig.pressing_scale = {INTERVAL}",
    }),
    "supply": (("rover-pin demo drive-log --hidden SupplySag.R_b=3", "rover-pin close-loop demo-drive-log"), SAG),
    "recording": ((
        "rover-pin demo recording --hidden SupplySag.R_b=3",
        "rover-pin import-log demo-recording/recording.csv --out my-log",
        "rover-pin close-loop my-log",
    ), SAG),
    "ditch": (("rover-pin drive ditch --set duration=30",), {"speed": rf"drives on at {NUMBER} m/s"}),
    "table_1_ditch": (("rover-pin drive ditch --soil table-1",), {"x t": rf"stuck at x = {NUMBER} m since {NUMBER} s"}),
    "paper_flat": (("rover-pin drive flat --soil table-1 --set form=net",), {
        "t x": rf"end time s {NUMBER} .*?end x m {NUMBER}",
    }),
    "motors": (("python studies/motors.py",), {"nominal saturated": rf"deg reached at \[s\] {NUMBER} {NUMBER}"}),
    "fig8_slope": (("python studies/fig8_slope.py",), {
        "switches": rf"R = 0.03(?: {WORD}){{11}} {NUMBER}", "digs": rf"c_d = 0.05(?: {WORD}){{11}} {NUMBER}",
    }),
    "fig8_loop": (("python studies/fig8_loop.py",), {
        "log before after": rf"climb-1 {NUMBER} {NUMBER} {WORD} {NUMBER} ",
    }),
    "side_force": (("python studies/side_force.py",), {
        "old": rf"across old: SideShear(?: {WORD}){{3}} {NUMBER}",
        "new": rf"across new: combined shear, flank(?: {WORD}){{3}} {NUMBER}",
    }),
    "paper_residuals": (("python studies/paper_residuals.py",), {
        "net sentences torque": rf"Table 1 breaks {NUMBER} of {NUMBER} in the net form, {NUMBER} in the torque",
    }),
    "identify_wheel": (("rover-pin identify cmu-smooth-wheel",), {
        "phi phi_low phi_high exit_share":
            rf"soil.phi = {INTERVAL}: its variance depends on the assumed soil.exit_ratio \({NUMBER}%\)",
        "pull": rf"drawbar pull: RMSE {NUMBER} N over 15 points",
        "pressing pressing_low pressing_high": rf"rig.pressing_scale = {INTERVAL}",
    }),
    "identify_both": (("rover-pin identify cmu-smooth-wheel cmu-smooth-wheel-skid",), {
        "pull": rf"drawbar pull: RMSE {NUMBER} N over 24",
    }),
    "identify_log": (("rover-pin identify steepening-slope",), {
        "k k_low k_high theta_1_share":
            rf"soil.k = {INTERVAL}: its variance depends on the declared soil.theta_1 \({NUMBER}%\)",
        "phi phi_low phi_high": rf"soil.phi = {INTERVAL}",
    }),
    "table_1": (("python studies/identify_table1.py",), {
        "k_low k_high phi_low phi_high": rf"net 50 {NUMBER} {NUMBER} {NUMBER} {NUMBER} {WORD} none",
    }),
    "transients": (("python studies/close_the_loop.py",), {
        "base": rf" base at once {NUMBER} ", "relaxing": rf"SlipSinkage relaxing {NUMBER} ",
        "known": rf" as measured relaxing {NUMBER} ",
    }),
}  # fmt: skip


def run(command: str, folder: Path) -> str:
    """Return what a command prints in a folder, in one line."""
    program, *words = shlex.split(command)
    if program == "python":
        words[0] = str(ROOT / words[0])
    start = ["-m", "rover_pin.cli.app"] if program == "rover-pin" else []
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, *start, *words], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return " ".join(done.stdout.split())


def measure(name: str, folder: Path) -> dict[str, Any]:
    """Run the commands of a name and return the numbers that the last one prints."""
    commands, patterns = COMMANDS[name]
    printed = [run(command, folder) for command in commands][-1]
    numbers: dict[str, Any] = {}
    for fields, pattern in patterns.items():
        found = re.search(pattern, printed)
        if found is None:
            raise SystemExit(f"{commands[-1]}: does not print {pattern}:\n{printed[:3000]}")
        numbers |= dict(zip(fields.split(), map(ast.literal_eval, found.groups()), strict=True))
    return numbers


def main() -> None:
    """Run every command, or those named, and write the table."""
    import tomllib

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of the table; all of them where none is named")
    names = parser.parse_args().names or list(COMMANDS)
    tables = tomllib.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            tables[name] = {"command": COMMANDS[name][0][-1], **measure(name, Path(folder))}
        KEPT.write_text(
            "".join(
                map(
                    section,
                    [each for each in COMMANDS if each in tables],
                    [tables[each] for each in COMMANDS if each in tables],
                )
            ),
            encoding="utf-8",
        )
        print(f"{name}: {tables[name]}", flush=True)


def section(name: str, table: dict[str, Any]) -> str:
    """Return a table as the file has it."""
    rows = [f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value!r}" for key, value in table.items()]
    return "\n".join([f"[{name}]", *rows, "", ""])


if __name__ == "__main__":
    main()
