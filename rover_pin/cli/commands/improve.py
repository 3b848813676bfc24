"""`rover-pin improve`: from a log or a rig set to gains, with what they are expected to gain."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.options import AsJson, Effects, Out, Trusted
from rover_pin.cli.terminal import report, stages, stoppable

log = logging.getLogger(__name__)


def improve(
    data: Annotated[
        Path, typer.Argument(help="Folder with drive.toml or rig.toml, or with the results of close-loop on one.")
    ],
    study: Annotated[
        Path | None, typer.Option(help="A tuning study's TOML file: drives and free numbers; else the usual grounds.")
    ] = None,
    effects: Effects = None,
    trust: Trusted = False,
    workers: Annotated[int, typer.Option(help="Processes; 0 for all cores.")] = 0,
    out: Out = Path("out/improve"),
    as_json: AsJson = False,
) -> None:
    """Tune the control on data, and predict what it gains. It closes the loop, and tunes over what that leaves open.

    Written are the model and its posterior (loop), the gains that `drive --set control.gains=` takes (control), and
    improve.json. Where no gain is certain, it is said.
    """
    from rover_pin.base.trust import Trust
    from rover_pin.tuning.improve import improve as improved
    from rover_pin.tuning.study_file import read_tuning

    chosen = None if study is None else read_tuning(study, Trust.of(effects, trust))
    say = (lambda message: None) if as_json else log.info
    with stoppable(out, ("improve.json", "loop", "control")):
        result = improved(data, out, chosen, effects, trust, say, stages(as_json), workers)
    report(result.summary(), as_json)
