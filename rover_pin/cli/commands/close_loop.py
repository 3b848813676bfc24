"""`rover-pin close-loop`: the loop on a wheel-rig set, a drive log or a test bed, and what is said at its end."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.commands.view import open_page
from rover_pin.cli.options import FAILED, AsJson, Effects, FailOn, Out, Scheduler, Trusted
from rover_pin.cli.terminal import stoppable

log = logging.getLogger(__name__)
REPORT = "report.html"


def close_loop(
    data: Annotated[
        list[Path], typer.Argument(help="Folder with rig.toml or drive.toml; of rig sets in one sand, several.")
    ],
    model: Annotated[Path | None, typer.Option(help="Model file to start from, as an earlier run wrote it.")] = None,
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/close_loop"),
    workers: Annotated[int, typer.Option(help="Processes for a drive log; 0 for all cores.")] = 0,
    scheduler: Scheduler = "",
    experiment: Annotated[
        str | None, typer.Option(help="Your own test bed: its file, motor_brake or pendulum.")
    ] = None,
    fail_on: FailOn = "",
    open_: Annotated[bool, typer.Option("--open", help="Open the report in your browser.")] = False,
    as_json: AsJson = False,
) -> None:
    """Find the effect that the model lacks, add it, and report. It prints errors before and after; killed, it resumes.

    Exit codes: 0 an answer, whatever it is; 2 data or words that are refused; 3 an answer named by --fail-on.
    """
    import json

    from rover_pin.discrepancy.answer import answers_named
    from rover_pin.loop.close import close_the_loop
    from rover_pin.report.labels import labels_of
    from rover_pin.report.verdict_page import first_lines

    failing = answers_named(fail_on)
    say = (lambda message: None) if as_json else log.info
    with stoppable():
        verdict = close_the_loop(
            data[0] if len(data) == 1 else tuple(data), model, effects, out, say,
            jobs=workers, scheduler=scheduler or None, experiment=experiment, trust=trust,
        )  # fmt: skip
    if as_json:
        print(json.dumps(verdict.as_dict(), default=str))
    else:
        print(f"{first_lines(verdict, labels_of(verdict))}\n\n{verdict.summary()}\nwritten: {out / REPORT}")
    if open_:
        open_page(out, REPORT)
    if verdict.answer in failing:
        log.warning("the answer '%s' is one of --fail-on %s", verdict.answer.value, fail_on)
        raise typer.Exit(FAILED)
