"""`rover-pin demo`: a data set that one can answer, with what one wants hidden in it."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.cli.options import AsJson
from rover_pin.cli.terminal import progress, report
from rover_pin.demo import SETS


def demo(
    kind: Annotated[str, typer.Argument(help="rig, drive-log or slip-slope.")],
    hidden: Annotated[
        str, typer.Option(help="What to hide: EFFECT or EFFECT.name=value, any (chance chooses), nothing.")
    ] = "any",
    seed: Annotated[int, typer.Option(help="Of the noise, the true soil and the choice.")] = 0,
    rover: Annotated[str, typer.Option(help="nexus6, cart, or your rover's TOML; not for a rig.")] = "nexus6",
    tell: Annotated[bool, typer.Option("--tell", help="Say what was hidden.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the set; else demo-KIND.")] = None,
    as_json: AsJson = False,
) -> None:
    """Make up a data set to try the loop on, truth beside it."""
    if kind not in SETS:
        raise ParameterError(f"There is no demo '{kind}': {closest(kind, SETS)}")
    if kind == "rig" and rover != "nexus6":
        raise ParameterError("A rig has no rover: leave --rover out, or make a drive-log or slip-slope.")
    folder = out or Path(f"demo-{kind}")
    others = [file for set_kind, file in SETS.items() if set_kind != kind and is_file(folder / file)]
    if others:
        raise ParameterError(f"{folder}: another kind of set is there ({others[0]}): give another --out.")
    from rover_pin.demo import drive_log, rig, slip_slope
    from rover_pin.demo import hidden as hiding

    with alone_in(folder):
        if kind == "rig":
            demo_set = rig.write(folder, hidden, seed)
        elif kind == "slip-slope":
            demo_set = slip_slope.write(folder, hidden, seed, rover)
        else:
            with progress("driving", drive_log.RUNS, silent=as_json) as advance:
                demo_set = drive_log.write(folder, hidden, seed, rover, advance)
    answer = {"hidden": demo_set.truth["hidden"]} if tell else {}
    truth = {"truth": str(hiding.truth_file(folder)), **answer}
    report({"files": list(map(str, demo_set.files)), **truth, "next": f"rover-pin close-loop {folder}"}, as_json)
