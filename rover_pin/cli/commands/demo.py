"""`rover-pin demo`: makes up a data set whose missing effect is known, so that a user can try close-loop on it."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.cli.options import AsJson, NamedOut, RoverName
from rover_pin.cli.terminal import progress, report
from rover_pin.demo import SETS


def demo(
    kind: Annotated[str, typer.Argument(help="rig, drive-log, recording or slip-slope.")],
    hidden: Annotated[
        str, typer.Option(help="The hidden effect: EFFECT or EFFECT.name=value, any (chosen at random), or nothing.")
    ] = "any",
    seed: Annotated[int, typer.Option(help="Seed of the noise, of the true soil and of the choice.")] = 0,
    rover: RoverName = "",
    tell: Annotated[bool, typer.Option("--tell", help="Print the hidden effect.")] = False,
    out: NamedOut = None,
    as_json: AsJson = False,
) -> None:
    """Make up a data set to try the loop on. The truth is written next to it; the folder is demo-KIND by default."""
    if kind not in SETS:
        raise ParameterError(f"There is no demo '{kind}': {closest(kind, SETS)}")
    if kind == "rig" and rover:
        raise ParameterError("A rig has no rover: leave --rover out, or make a drive-log, recording or slip-slope.")
    folder = out or Path(f"demo-{kind}")
    # A folder with two kinds of data sets would be read as the wrong kind later.
    others = [file for set_kind, file in SETS.items() if set_kind != kind and is_file(folder / file)]
    if others:
        raise ParameterError(
            f"{folder}: this folder holds a data set of another kind ({others[0]}): name another folder with --out."
        )
    from rover_pin.demo import drive_log, recording, rig, slip_slope
    from rover_pin.demo import hidden as hiding

    with alone_in(folder):
        if kind == "rig":
            demo_set = rig.write(folder, hidden, seed)
        elif kind == "slip-slope":
            demo_set = slip_slope.write(folder, hidden, seed, rover or "nexus6")
        elif kind == "recording":
            with progress("driving", recording.RUNS, silent=as_json) as advance:
                demo_set = recording.write(folder, hidden, seed, rover or "nexus6", advance)
        else:
            # Only a drive log is simulated drive by drive and takes long enough for a progress bar.
            with progress("driving", drive_log.RUNS, silent=as_json) as advance:
                demo_set = drive_log.write(folder, hidden, seed, rover or "nexus6", advance)
    # The hidden effect is the answer of the exercise, so it is printed only on request.
    answer = {"hidden": demo_set.truth["hidden"]} if tell else {}
    truth = {"truth": str(hiding.truth_file(folder)), **answer}
    step = f"import-log {shell_word(demo_set.files[0])}" if kind == "recording" else f"close-loop {shell_word(folder)}"
    report({"files": list(map(str, demo_set.files)), **truth, "next": f"rover-pin {step}"}, as_json)
