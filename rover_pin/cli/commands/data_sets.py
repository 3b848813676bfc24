"""`rover-pin init`, `import-log`, `check-data`, `demo`: make and check the data sets that close-loop reads.

`init` makes a wheel-rig set from a user's table of measurements, and `import-log` makes a drive log from recordings of
other programs. `check-data` checks a data set within seconds, before the user runs close-loop on the data. `demo`
simulates a data set whose missing effect is known, so that a user can try close-loop on it.
"""

import logging
from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import DataError, ParameterError, RoverPinError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Column, Gravity, NamedOut, Out, Radius, RoverName, Trusted, Width
from rover_pin.cli.terminal import assignments, formulas, progress, report, stoppable
from rover_pin.demo import SETS

log = logging.getLogger(__name__)


def init(
    table: Annotated[
        Path,
        typer.Argument(help="CSV or Parquet file with one row for each run, with slip, load and measured channels."),
    ],
    radius: Radius,
    width: Width,
    noise: Annotated[
        list[str],
        typer.Option(
            metavar="CHANNEL=SD",
            help="Standard deviation (SD) of a channel in one run, such as drawbar_pull=0.5N; by default it is "
            "estimated from repeated runs.",
        ),
    ] = [],  # noqa: B006 - typer wants a list
    column: Column = [],  # noqa: B006
    slip_definition: Annotated[
        str,
        typer.Option(
            help="The speed by which the slips are divided: eq-1 (the faster of rim speed and travel speed), "
            "over-travel-speed or over-rim-speed."
        ),
    ] = "eq-1",
    gravity: Gravity = "",
    out: NamedOut = None,
    as_json: AsJson = False,
) -> None:
    """Make a wheel-rig set from your own table of measurements, and check it. close-loop and identify can read the set.

    Columns are recognised by name and unit. The noise of a channel is taken from repeated runs, from a column with its
    standard deviation, or from --noise. The command prints how it read each column, even if it refuses the table.
    """
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.contact import Wheel
    from rover_pin.loop.data_check import check_data as check
    from rover_pin.measurements.checks import SLIP_DEFINITIONS
    from rover_pin.measurements.foreign_rig import RigTable, channel_unit, gravity_note, write_rig_set
    from rover_pin.parameters.gravity import gravity_named

    stated = {
        name: parse_quantity(sd, channel_unit(name), f"--noise {name}")
        for name, sd in assignments(noise, "--noise").items()
    }
    columns = formulas(column)
    if slip_definition not in SLIP_DEFINITIONS:
        raise ParameterError(f"--slip-definition {slip_definition}: choose one of {', '.join(SLIP_DEFINITIONS)}.")
    # Gravity at the test converts masses to weights.
    at_test = gravity_named(gravity) if gravity else None
    wheel = Wheel(r=parse_quantity(radius, "m", "--r"), b=parse_quantity(width, "m", "--b"))
    # The data set lies next to the table, in a folder with the name of the table, unless --out names another.
    folder = table.with_suffix("") if out is None else out
    if folder == table:
        raise ParameterError(f"{table}: the data set needs a folder of its own: name the folder with --out FOLDER.")

    read = RigTable(table, columns)
    files: list[Path] = []
    try:
        points = read.points(wheel, slip_definition)
        read.notes += filter(None, [gravity_note(points, at_test)])
        # The stated noise is used for its channels; the noise of the others comes from repeated runs or a column of
        # SDs.
        sds = read.noise(points, stated, slip_definition)
        is_new = not folder.exists()
        files = write_rig_set(folder, table.stem, points, wheel, sds, at_test, slip_definition)
        # The new set is read back and checked as close-loop would check it.
        data_check = check(folder)
    except RoverPinError:
        # A set that cannot be used is removed. The printed reading of the columns helps the user to correct the table.
        for file in files:
            file.unlink(missing_ok=True)
        if files and is_new:
            folder.rmdir()
        report({"columns": read.notes}, as_json)
        raise
    result: dict[str, Any] = {"files": list(map(str, files)), "columns": read.notes, "holds": data_check.holds}
    result["findings"] = list(map(str, data_check.findings))
    result["next"] = f"rover-pin close-loop {shell_word(folder)}"
    report(result, as_json)


def import_log(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings: CSV, Parquet or .mat files, ROS 1 or ROS 2 bags, or MCAP files.")
    ],
    rover: RoverName = "",
    out: NamedOut = None,
    column: Column = [],  # noqa: B006 - typer wants a list
    most: Annotated[
        int, typer.Option(help="Maximum number of runs; if there are more, the most informative runs are kept.", min=1)
    ] = 12,
    as_json: AsJson = False,
) -> None:
    """Make a drive log from recordings, and check it.

    Columns are recognised by name, unit and values; runs are cut at stops and gaps; missing channels are listed. By
    default, the folder of the log has the name of the first file.
    """
    from rover_pin.importing.import_log import import_log as imported
    from rover_pin.loop.data_check import check_data as check

    drive_log = imported(files, rover or "nexus6", out, formulas(column), most)
    folder = drive_log.files[-1].parent
    result: dict[str, Any] = {
        "written": str(drive_log.files[-1]),
        "columns": list(drive_log.columns),
        "runs": list(drive_log.runs),
        "lacks": list(drive_log.lacks),
        "notes": list(drive_log.notes),
    }
    # The new log is checked as close-loop would check it, so that the user sees its faults now.
    try:
        data_check = check(folder)
    # Also if the check refuses the new log, the user sees how its columns were read.
    except DataError:
        report(result, as_json)
        raise
    result |= {"holds": data_check.holds, "findings": list(map(str, data_check.findings))}
    result["next"] = (
        f"too poor: {data_check.too_poor}" if data_check.too_poor else f"rover-pin close-loop {shell_word(folder)}"
    )
    report(result, as_json)


def check_data(
    data: Annotated[Path, typer.Argument(help="Folder with rig.toml (a wheel-rig set) or drive.toml (a drive log).")],
    similarity: Annotated[
        bool,
        typer.Option(
            "--similarity",
            help="Find dimensionless groups in which the runs of a rig set at all loads lie on one curve.",
        ),
    ] = False,
    trust: Trusted = False,
    out: Out = Path("out/check_data"),
    as_json: AsJson = False,
) -> None:
    """Check measured data as close-loop does before its fits: units, signs, ranges, gaps, clock and excitation."""
    from rover_pin.loop.data_check import check_data as check

    data_check = check(data, Trust(everything=trust))
    # Data that are too poor for the loop are no error: the report is the result of this command.
    verdict = (
        f"too poor: {data_check.too_poor}"
        if data_check.too_poor
        else "the data can be used; rover-pin close-loop is the next step"
    )
    result: dict[str, Any] = {
        "data": str(data),
        "kind": data_check.kind,
        "holds": data_check.holds,
        "verdict": verdict,
        "findings": list(map(str, data_check.findings)),
    }
    if similarity:
        from rover_pin.experiments.wheel_rig.similarity import collapses, simplest
        from rover_pin.loop.data_check import rig_set_in
        from rover_pin.plot.similarity import similarity_figure

        with stoppable(out, ("similarity.csv", "similarity.png")), alone_in(out):
            rig_set = rig_set_in(data, Trust(everything=trust))
            rows = collapses(rig_set, lambda message: log.info("%s", message))
            files = similarity_figure(rig_set, rows, out)
        result["similarity"] = [row.sentence for row in simplest(rows).values()]
        result["files"] = list(map(str, files))
    report(result, as_json)


def demo(
    kind: Annotated[str, typer.Argument(help="Kind of the data set: rig, drive-log, recording or slip-slope.")],
    hidden: Annotated[
        str,
        typer.Option(
            help="The effect that is hidden in the data: EFFECT, EFFECT.name=value, any (chosen at random), or nothing."
        ),
    ] = "any",
    seed: Annotated[
        int, typer.Option(help="Seed of the random numbers, which give the noise, the true soil and the hidden effect.")
    ] = 0,
    rover: RoverName = "",
    tell: Annotated[bool, typer.Option("--tell", help="Print the hidden effect.")] = False,
    out: NamedOut = None,
    as_json: AsJson = False,
) -> None:
    """Simulate a data set with a hidden effect, on which a user can try close-loop.

    The true effect is written to a file next to the data. The folder of the data is demo-KIND by default.
    """
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
    from rover_pin.demo import drive_log, rig, slip_slope
    from rover_pin.demo import hidden as hiding

    with alone_in(folder):
        if kind == "rig":
            demo_set = rig.write(folder, hidden, seed)
        elif kind == "slip-slope":
            demo_set = slip_slope.write(folder, hidden, seed, rover or "nexus6")
        elif kind == "recording":
            with progress("driving", drive_log.RECORDED_RUNS, silent=as_json) as advance:
                demo_set = drive_log.write_recording(folder, hidden, seed, rover or "nexus6", advance)
        else:
            # Only a drive log is simulated drive by drive and takes long enough for a progress bar.
            with progress("driving", drive_log.RUNS, silent=as_json) as advance:
                demo_set = drive_log.write(folder, hidden, seed, rover or "nexus6", advance)
    # The hidden effect is the answer of the exercise, so it is printed only on request.
    answer = {"hidden": demo_set.truth["hidden"]} if tell else {}
    truth = {"truth": str(hiding.truth_file(folder)), **answer}
    step = f"import-log {shell_word(demo_set.files[0])}" if kind == "recording" else f"close-loop {shell_word(folder)}"
    report({"files": list(map(str, demo_set.files)), **truth, "next": f"rover-pin {step}"}, as_json)
