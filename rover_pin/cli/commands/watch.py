"""`rover-pin watch`: runs the monitor, which predicts stuck and buried wheels, on a recorded drive."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.trust import Trust
from rover_pin.cli.assumed import report_assuming
from rover_pin.cli.options import AsJson, Effects, ModelFile, Out, Run, Trusted
from rover_pin.cli.terminal import stoppable


def watch(
    log: Annotated[Path, typer.Argument(help="Folder of a drive log.")],
    run: Run = "",
    model: ModelFile = None,
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/watch"),
    as_json: AsJson = False,
) -> None:
    """Run the onboard monitor on a recorded drive, and print when the rover was about to get stuck or buried, and why.

    The file watch.csv holds the forecast of the monitor at every sample.
    """
    import pandas as pd

    from rover_pin import plot
    from rover_pin.base.files.paths import data_path
    from rover_pin.base.settings import Setting, numbers_of
    from rover_pin.effects.motion_resistance import MotionResistance
    from rover_pin.experiments.drive_log.model import base_model, has_current_scale, undeclared_constants
    from rover_pin.logs.drive_log import read_drive_log
    from rover_pin.onboard.monitor.monitor import CAUSES, Monitor
    from rover_pin.onboard.monitor.recording import alarms, forecasts_of, monitor_input
    from rover_pin.plot.forecast import forecast_figure
    from rover_pin.scenarios.assumptions import assumptions_of
    from rover_pin.simulation.model.toml_file import read_model
    from rover_pin.terrain.shapes import flat

    trusted = Trust.of(effects, trust)
    drive_log = read_drive_log(data_path(log), trusted)
    trace = drive_log.run(run) if run else drive_log.runs[0]
    # Without a model of the user, the monitor uses the base model that the log itself declares.
    watched_model = base_model(drive_log) if model is None else read_model(model, flat(), trusted)
    monitor = Monitor.of(watched_model)
    # The monitor gets only signals that a rover has on board; a missing signal is replaced by an assumed value.
    readings = monitor_input(trace, watched_model, monitor.estimate.period, has_current_scale(drive_log))
    with stoppable(out, ("watch.csv", "watch.png")), alone_in(out):
        forecasts = forecasts_of(monitor, readings)
        rows = pd.DataFrame(forecasts).rename(columns={"t": "t_s"})
        # The probabilities of the causes are one column each, such as p_grip_lost.
        rows[[f"p_{cause.replace(' ', '_')}" for cause in CAUSES]] = rows.pop("causes").tolist()
        table = plot.write_csv(rows, out / "watch.csv")
        figure = plot.save(
            forecast_figure(forecasts, f"{drive_log.metadata.name}: {trace.attrs['file']}"), out / "watch.png"
        )
    # One line for each interval of alarm.
    lines = [
        f"{begin:.2f} to {end:.2f} s: {cause}, P(stuck) up to {p_stuck:.2f}, P(buried) up to {p_buried:.2f}"
        for begin, end, p_stuck, p_buried, cause in alarms(forecasts)
    ]
    # A forecast holds only for the soil, motor and resistance of the model, so constants that the log does not declare
    # are named.
    records = {
        "soil": watched_model.soils[0],
        "motor": watched_model.motor,
        "resistance": watched_model.effect(MotionResistance),
    }
    undeclared = [
        f"[{title}] of the log does not declare {', '.join(values)}; the forecasts hold for "
        + ", ".join(f"{name} = {value}" for name, value in values.items())
        for title, values in undeclared_constants(drive_log, {} if model is not None else records).items()
    ]
    assumed = [*undeclared, *readings.assumed]
    # All numbers of these records are assumed, except those that the log states in its tables, or a model file.
    numbers, given = list[Setting](), {"model"} if model is not None else set[str]()
    for title, record in records.items():
        owner = "effect.MotionResistance" if title == "resistance" else title
        numbers += numbers_of(record, owner)
        given |= {f"{owner}.{name}" for name in getattr(drive_log.metadata, title)}
    result: dict[str, Any] = {"run": trace.attrs["file"], "watched_s": float(readings.t[-1] - readings.t[0])}
    result |= {"alarms": lines, "assumed": assumed, "files": [str(table), str(figure)]}
    report_assuming(result, assumptions_of(numbers, given), as_json, out)
