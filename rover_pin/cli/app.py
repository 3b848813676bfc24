"""rover-pin: drive a planetary rover on loose soil, and study what its wheels do."""

import logging
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.console import say, warn
from rover_pin.base.encode import shell_line, shell_word
from rover_pin.base.errors import NO_ROOM, ParameterError, RoverPinError, one_line
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in, say_what_is_replaced
from rover_pin.base.jobs.safe_environment import leave_folder_out
from rover_pin.base.trust import Trust
from rover_pin.cli import commands
from rover_pin.cli.assumed import assumed_by_bounds, assumed_by_sweep, report_assuming, weighed_by_drives
from rover_pin.cli.commands.view import SEEN, open_page, requested_files, write_requested
from rover_pin.cli.completing import engine_names, scenario_names
from rover_pin.cli.options import (
    Add,
    AsJson,
    Control,
    Effects,
    Gif,
    Gravity,
    ModelFile,
    Mp4,
    NamedOut,
    Open,
    Out,
    RoverName,
    Scheduler,
    Set,
    SoilName,
    Trusted,
    Workers,
)
from rover_pin.cli.speaking import Program, program
from rover_pin.cli.terminal import (
    drive_settings,
    json_text,
    priors,
    progress,
    report,
    soil_and_wheel,
    stages,
    stoppable,
)

log = logging.getLogger("rover_pin.cli.app")  # its name also where it is run by python -m
app = typer.Typer(
    cls=Program, rich_markup_mode=None, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__
)


def main() -> None:
    """Run the command line.

    If the command fails by an error that the user can correct, the error is printed on one line, and the program ends
    with exit code 2.
    """
    try:
        app()
    except RoverPinError as error:
        # The message of this package is one line already and states the remedy, so no traceback is printed.
        warn(f"rover-pin: {error}")
        sys.exit(2)
    except (MemoryError, ImportError) as error:
        # A library that cannot be loaded for lack of memory raises an ImportError; any other ImportError is a fault of
        # the program.
        if isinstance(error, ImportError) and NO_ROOM not in str(error):
            raise
        warn(
            "rover-pin: this command needs more memory than it may use, which is half of the machine's memory or the "
            "limit of ulimit -v; use a smaller file or fewer samples."
        )
        sys.exit(2)
    except OSError as error:
        # An OSError without a number does not come from the system, so it is a fault of the program.
        if error.errno is None:
            raise
        # For example a full disk, or a folder without permission to write.
        file = f"{error.filename}: " if error.filename else ""
        message = one_line(f"{file}{error.strerror}; free space on the disk, or name another file or folder.")
        warn(f"rover-pin: {message}")
        sys.exit(2)


@app.command()
def drive(
    scenario: Annotated[
        str,
        typer.Argument(
            autocompletion=scenario_names,
            help="Name of a scenario, such as ditch (rover-pin list scenarios), or a TOML file that --save wrote.",
        ),
    ],
    rover: RoverName = "",
    control: Control = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006 - typer wants a list
    set_: Set = [],  # noqa: B006
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Write the drive's settings to this TOML file; `rover-pin drive FILE` repeats it."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Write view.html, a page that shows the drive in 3D.")] = False,
    gif: Gif = False,
    mp4: Mp4 = False,
    open_: Open = False,
    effects: Effects = None,
    trust: Trusted = False,
    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            autocompletion=engine_names,
            help="The code that computes the motion of the rigid bodies: compiled (generated C code), or "
            "pinocchio-crba or pinocchio-aba (slow algorithms of the library Pinocchio, to check the compiled code).",
        ),
    ] = "compiled",
    out: Out = Path("out/drive"),
    as_json: AsJson = False,
) -> None:
    """Simulate the drive of a scenario. Writes a drive log and figures, and prints a summary.

    If --model names a folder, the scenario is driven on every model of the folder, and the figure shows quantiles over
    the models. Exit code 1: the simulation diverged.
    """
    from rover_pin.scenarios.scenario import scenario as ready
    from rover_pin.simulation.engines import engine_named

    # An unknown name is refused here, before the results of an earlier drive are removed.
    engine_named(engine)
    settings = drive_settings(set_, rover=rover, control=control, gravity=gravity, soil=soil, model=model, add=add)
    # Naming a controller's file on the command line is the consent to run it, as with --effects.
    own = Path(control) if control.endswith(".py") else None
    settings["trust"] = Trust.of([file for file in (effects, own) if file], trust)
    views = requested_files(view or open_, gif, mp4)
    if model is not None and model.is_dir():
        # Pages, films and drive files hold a single drive, so they are refused before the models are driven.
        if views or save:
            raise ParameterError(
                f"a page, GIF, film or drive file holds a single drive, but {model} is a folder of models: give "
                "--model one of its files."
            )
        with stoppable(out, ("bands.csv", "bands.png")), alone_in(out):
            summary, assumptions = _drive_models(scenario, model, settings, out, engine)
            report_assuming(summary, assumptions, as_json, out)
        return
    chosen = ready(scenario, **settings)
    if save is not None:
        # The settings are saved before the drive, so that a drive that fails can be repeated too.
        say_what_is_replaced(save.parent, (save.name,))
        log.info("To repeat this drive, run rover-pin drive %s", shell_word(chosen.save(save)))
    # Views of an earlier drive would otherwise be taken for views of this one.
    untouched = [name for name in SEEN if name not in views]
    with (
        stoppable(out, ("log/drive.toml", "snapshots.png", "history.png", "assumed.csv", *views), untouched),
        alone_in(out),
    ):
        _drive_scenario(chosen, scenario, settings, engine, views, out, as_json)
    # The browser opens only after the lock on the folder has been released.
    if open_:
        open_page(out)


def _drive_scenario(
    chosen: Any, name: str, settings: Mapping[str, Any], engine: str, views: list[str], out: Path, as_json: bool
) -> None:
    """Simulate the drive of a scenario, write its log, its figures and the view files `views`, and print the summary.

    Raises typer.Exit with code 1: the simulation diverged.
    """
    with progress(f"driving {chosen.name}", chosen.duration, silent=as_json) as advance:
        trace = chosen.drive(advance, engine=engine)
    log.debug("driven: %d rows of the trace", len(trace["t_s"]))
    # A drive that diverges at once has no rows, and so neither log nor figures.
    result: dict[str, Any] = {"scenario": chosen.name, **trace.summary()}
    if len(trace["t_s"]):
        from rover_pin import plot
        from rover_pin.rover.wheel_base import base_of
        from rover_pin.terrain.terrain import slope_and_roughness

        # Slope and roughness of the ground under the path, at about a thousand places; zero on level ground.
        model, every = chosen.model, max(len(trace.t) // 1000, 1)
        place = trace["body_x"][::every], trace["body_y"][::every]
        slope, roughness = slope_and_roughness(model.terrain, *place, base_of(model.rover).length)
        ground = {"max_ground_slope_deg": math.degrees(slope.max()), "max_ground_roughness_mm": 1e3 * roughness.max()}
        result |= ground if any(ground.values()) else {}
        chosen.write_log(trace, out / "log")
        figures = plot.drive_figures(trace, chosen.model, out)
        result["files"] = list(map(str, [out / "log", *figures, *write_requested(chosen, trace, views, out)]))
    assumptions = weighed_by_drives(chosen, trace, name, settings)
    error = float(trace.attrs.get("step_error_m", 0.0))
    report_assuming(result, assumptions, as_json, out, {"distance_m": "m"}, error)
    # The summary and the rows before the failure are printed first, and then the exit code reports the failure.
    if str(trace.attrs["stop"]).startswith("diverged"):
        raise typer.Exit(1)


def _drive_models(
    name: str, folder: Path, settings: dict[str, Any], out: Path, engine: str
) -> tuple[dict[str, Any], Any]:
    """Drive a scenario on each model of a folder, write bands.csv and bands.png, and return a summary over the models,
    and the assumptions about everything that the models do not state.

    The models must be equally probable, such as the models in the folder `posterior` of a close-loop run. `name` is the
    scenario, `settings` are the user's settings of the drive, `out` is the folder of the results, and `engine` is the
    name of the engine that computes the steps.
    """
    from rover_pin.comparison.bands import drive_on_models
    from rover_pin.plot import save, write_csv
    from rover_pin.plot.bands import bands_figure
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.simulation.model.toml_file import models_of

    files = models_of(folder)
    # The models of the folder replace the single model of the settings.
    other_settings = {key: value for key, value in settings.items() if key != "model"}
    drives = drive_on_models(name, files, other_settings, engine=engine)
    title = (
        f"{name} on {len(files)} models of {folder.name}: stuck on {sum(drives.stuck)}, buried on {sum(drives.buried)}"
    )
    paths = [
        write_csv(drives.table(), out / "bands.csv"),
        save(bands_figure(drives.t, drives.panels, title), out / "bands.png"),
    ]
    assumptions = scenario(name, **{**other_settings, "model": str(files[0])}).assumptions
    return {"scenario": name, **drives.summary(), "files": list(map(str, paths))}, assumptions


@app.command("check-urdf")
def check_urdf(
    file: Annotated[
        Path, typer.Argument(help="A rover's TOML file, a URDF without a TOML file, or a name from `list rovers`.")
    ],
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Check the files of a rover. Prints the faults, whether the rover stands and moves, and the assumed numbers.

    Exit code 1: the rover has faults.
    """
    from rover_pin.rover.description.layout import shipped_toml
    from rover_pin.rover.rover import load_rover
    from rover_pin.rover.urdf_check import check_urdf as check
    from rover_pin.scenarios.road_check import road_check

    # A word that is no file is the name of a rover of the package.
    name = file
    if not is_file(file):
        file = shipped_toml(str(name))
    urdf_report = check(file, Trust(everything=trust))
    result: dict[str, Any] = {name: list(getattr(urdf_report, name)) for name in ("faults", "notes", "facts")}
    if urdf_report.ok and urdf_report.loads:
        # A rover without faults in its files must also carry its weight and have motors that move it on its soil.
        road = road_check(load_rover(file, Trust(everything=trust)))
        result["faults"] += road.faults
        result |= {"stands": road.stands, "moves": road.moves, "assumed": list(road.assumed)}
    if not result["faults"] and file.suffix == ".toml":
        result["next"] = shell_line(["rover-pin", "drive", "flat", "--set", f"rover={name}"])
    report({"file": str(file), **result}, as_json)
    if result["faults"]:
        raise typer.Exit(1)


@app.command()
def sweep(
    study: Annotated[Path, typer.Argument(help="TOML file of the study: scenario, parameters and their values.")],
    workers: Workers = 0,
    scheduler: Scheduler = "",
    effects: Effects = None,
    trust: Trusted = False,
    out: NamedOut = None,
    as_json: AsJson = False,
) -> None:
    """Run a batch study, which is one drive for each combination of parameter values.

    If a study was stopped, the same command finishes it. By default, the results are written to out/NAME, where NAME is
    the name of the study.
    """
    from rover_pin.sweep import read_study
    from rover_pin.sweep import sweep as run

    loaded_study = read_study(study, Trust.of(effects, trust))
    with stoppable():
        result = run(loaded_study, out, workers=workers or None, scheduler=scheduler or None)
    report_assuming(result.summary(), assumed_by_sweep(loaded_study), as_json, result.folder)


@app.command()
def bounds(
    slope_deg: Annotated[
        str, typer.Option(help="Slope of the ground, positive uphill [deg]; other units as in 0.1rad.")
    ] = "0",
    soil: SoilName = "",
    slip: Annotated[str, typer.Option(help="Slip limit, above 0 and up to 1, such as 0.2 or 20%.")] = "0.2",
    form: Annotated[str, typer.Option(help="The traction factor to use: net, torque or gross.")] = "",
    rover: RoverName = "",
    gravity: Gravity = "",
    model: ModelFile = None,
    set_: Set = [],  # noqa: B006
    effects: Effects = None,
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Print the torque that each wheel can transmit to the soil, the motor's margin, and the steepest climbable slopes.

    `climbable` is the slope on which the pull at a slip of 1 just balances weight and motion resistance: the rover
    stands still there, and creeps on slopes that are a few degrees gentler. `climbable at slip limit` is the slope that
    the rover climbs with all wheels at the slip limit.

    Only the traction and the motion resistance of a model count, not its other effects. If --model names a folder, such
    as a loop's `posterior`, the printed bounds hold for the next model with a probability of 90 %.
    """
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.control.rover_bounds import bounds_of_model, bounds_table
    from rover_pin.scenarios.assumptions import with_influence
    from rover_pin.scenarios.scenario import scenario

    slope, slip_limit = parse_quantity(slope_deg, "rad", "--slope-deg", "deg"), parse_quantity(slip, "", "--slip")
    allowed = Trust.of(effects, trust)
    settings = {**drive_settings(set_, rover=rover, soil=soil, form=form, gravity=gravity), "trust": allowed}
    if model is not None and model.is_dir():
        from rover_pin.simulation.model.toml_file import models_of
        from rover_pin.tuning.improve import predicted_bounds

        # For a folder of models, the bounds are quantiles over the models.
        files = models_of(model)
        over = predicted_bounds(files, settings, slip_limit, slope)
        shared = assumed_by_bounds(scenario("flat", **settings, model=str(files[0])).assumptions)
        report_assuming({name: value.words() for name, value in over.items()}, shared, as_json)
        return
    settings |= {"model": str(model)} if model else {}
    level = scenario("flat", **settings)
    wheel_bounds, result = bounds_of_model(level.model, slip_limit, slope)

    def climbable(changes: Mapping[str, float]) -> dict[str, float]:
        bounded = bounds_of_model(scenario("flat", **{**settings, **changes}).model, slip_limit, slope)[1]
        return {name: float(bounded[name]) for name in ("climbable_at_slip_limit_deg", "climbable_deg")}

    assumptions = with_influence(assumed_by_bounds(level.assumptions), climbable)
    if not as_json:
        say(bounds_table(wheel_bounds, level.model.motor))
        result = {name: value for name, value in result.items() if name != "wheels"}
    report_assuming(result, assumptions, as_json, decisive={"climbable_at_slip_limit_deg": "deg"})


@app.command()
def identify(
    data: Annotated[
        list[Path],
        typer.Argument(
            help="Folder with rig.toml or drive.toml, several folders with rig.toml, or a CSV file with the columns "
            "slip, traction_factor and sd."
        ),
    ],
    set_: Set = [],  # noqa: B006
    prior: Annotated[
        list[str], typer.Option(help="Prior of a number as NAME=MEAN:SD, such as phi=30deg:2deg; can be repeated.")
    ] = [],  # noqa: B006
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Fit the numbers of soil and wheel to data, and print which numbers the data determine.

    The command close-loop begins with this fit. --set fixes a number at a value, and --prior replaces its prior. All
    other priors are declared by the data, or assumed. For each estimate, the priors are listed on which it depends.
    """
    from rover_pin.contact import Soil, Wheel
    from rover_pin.loop.data_check import measured_in
    from rover_pin.loop.identify import identify as identified

    # Names of the form soil.phi and wheel.r, under which the fit knows its numbers.
    fixed = {
        f"{owner}.{name}": value
        for owner, numbers in zip(("soil", "wheel"), soil_and_wheel(set_, Soil(), Wheel()), strict=True)
        for name, value in numbers.items()
    }
    measured, findings = measured_in(data[0] if len(data) == 1 else tuple(data), Trust(everything=trust))
    # With --json, the output is read by a program, so no progress is logged.
    progress_line = (lambda message: None) if as_json else log.info
    result = identified(measured, priors(prior), fixed, progress=progress_line)
    # The findings of the check are logged before the result, because they limit the trust in the numbers.
    for finding in findings:
        log.warning("%s", finding)
    say(json_text(result.as_dict()) if as_json else result.report())


@app.command()
def tune(
    study: Annotated[Path, typer.Argument(help="TOML file of the tuning study: its drives and the gains to tune.")],
    model: ModelFile = None,
    workers: Workers = 0,
    scheduler: Scheduler = "",
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/tune"),
    as_json: AsJson = False,
) -> None:
    """Tune the gains of the slip control over an ensemble of simulated drives.

    The drives can have sensor noise. If a tuning was stopped, the same command finishes it.
    """
    from rover_pin.scenarios.assumptions import shared_by
    from rover_pin.simulation.model.toml_file import models_of
    from rover_pin.tuning.drives import build, cautions
    from rover_pin.tuning.study_file import read_tuning
    from rover_pin.tuning.tune import tune_gains

    allowed = Trust.of(effects, trust)
    tuning_study = read_tuning(study, allowed)
    tuning_study = (tuning_study if model is None else tuning_study.on_model(*models_of(model))).trusting(allowed)
    # Before the long run, the log names the effects that the tuning cannot consider, so that the user may stop it.
    for line in cautions((*tuning_study.training, *tuning_study.held_out)):
        log.warning("%s", line)
    with stoppable(out, ("gains.toml", "drives.csv", "candidates.csv", "drives.png", "frontier.png")):
        result = tune_gains(tuning_study, out, stages(as_json), workers or None, scheduler or None)
    shared = shared_by(build(case).assumptions for case in (*tuning_study.training, *tuning_study.held_out))
    # The tuning itself chooses the control, so that the control of the scenarios is not assumed.
    read = [entry for entry in shared if entry.name.split(".")[0] != "control"]
    report_assuming(result.summary(), read, as_json, out)


app.callback(help=__doc__)(program)
commands.add_to(app)

if __name__ == "__main__":
    leave_folder_out()
    main()
