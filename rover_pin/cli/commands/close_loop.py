"""`rover-pin close-loop`: runs the loop on a wheel-rig set, a drive log or an experiment, and prints the answer."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.console import say
from rover_pin.cli.commands.view import open_page
from rover_pin.cli.options import FAILED, AsJson, Effects, FailOn, ModelFile, Open, Out, Scheduler, Trusted, Workers
from rover_pin.cli.terminal import stoppable

log = logging.getLogger(__name__)
REPORT = "report.html"


def close_loop(
    data: Annotated[
        list[Path],
        typer.Argument(
            help="Folder with rig.toml or drive.toml, or several folders with rig.toml, measured in one sand."
        ),
    ],
    model: ModelFile = None,
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/close_loop"),
    workers: Workers = 0,
    scheduler: Scheduler = "",
    experiment: Annotated[
        str | None, typer.Option(help="Experiment that reads the data: your Python file, or motor_brake or pendulum.")
    ] = None,
    fail_on: FailOn = "",
    open_: Open = False,
    as_json: AsJson = False,
) -> None:
    """Find the effect that a model lacks compared with measured data, add it, and report the errors before and after.

    If a search on a drive log was stopped, the same command continues it. Exit codes: 0 for any answer, 2 for data or
    options that are refused, 3 for an answer that --fail-on lists.
    """
    import json

    from rover_pin.discrepancy.answer import answers_named
    from rover_pin.loop.close import close_the_loop
    from rover_pin.report.labels import labels_of
    from rover_pin.report.verdict_page import first_lines

    # The words of --fail-on are checked before the long run, so that a misspelt word does not waste it.
    failing = answers_named(fail_on)
    note_progress = (lambda message: None) if as_json else log.info
    with stoppable():
        verdict = close_the_loop(
            data[0] if len(data) == 1 else tuple(data), model, effects, out, note_progress,
            jobs=workers, scheduler=scheduler or None, experiment=experiment, trust=trust,
        )  # fmt: skip
    if as_json:
        say(json.dumps(verdict.as_dict(), default=str))
    # People read the answer in a few sentences first; the table and the path of the report follow.
    else:
        say(f"{first_lines(verdict, labels_of(verdict))}\n\n{verdict.summary()}\nwritten: {out / REPORT}")
    if open_:
        open_page(out, REPORT)
    if verdict.answer in failing:
        log.warning("exit code 3, because --fail-on %s lists the answer '%s'", fail_on, verdict.answer.value)
        raise typer.Exit(FAILED)
