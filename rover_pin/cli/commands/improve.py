"""`rover-pin improve`: tunes control gains on a drive log or a rig set, and predicts their benefit."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.options import AsJson, Effects, Out, Trusted, Workers
from rover_pin.cli.terminal import report, stages, stoppable

log = logging.getLogger(__name__)


def improve(
    data: Annotated[
        Path, typer.Argument(help="Folder with drive.toml or rig.toml, or the results folder of close-loop.")
    ],
    study: Annotated[
        Path | None,
        typer.Option(
            help="TOML file of a tuning study, with its drives and the gains to tune; by default, drives on "
            "slopes, hills and rocks and through ditches."
        ),
    ] = None,
    effects: Effects = None,
    trust: Trusted = False,
    workers: Workers = 0,
    out: Out = Path("out/improve"),
    as_json: AsJson = False,
) -> None:
    """Tune the slip control for a measured rover or wheel, and predict the benefit.

    The command runs close-loop on the data, and then tunes the gains over the models that remain possible. It writes
    the model and its posterior (folder loop), the gains for `drive --set control.gains=FILE` (folder control), and
    improve.json. If no benefit is certain, the result states this.
    """
    from rover_pin.base.trust import Trust
    from rover_pin.tuning.improve import improve as improved
    from rover_pin.tuning.study_file import read_tuning

    # The study is read before the loop starts, so that an error in it does not waste a long run.
    chosen = None if study is None else read_tuning(study, Trust.of(effects, trust))
    note_progress = (lambda message: None) if as_json else log.info
    with stoppable(out, ("improve.json", "loop", "control")):
        result = improved(data, out, chosen, effects, trust, note_progress, stages(as_json), workers)
    report(result.summary(), as_json)
