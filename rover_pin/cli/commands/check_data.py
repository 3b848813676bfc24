"""`rover-pin check-data`: checks measured data within seconds, before the user runs close-loop on the data."""

import logging
from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Out, Trusted
from rover_pin.cli.terminal import report, stoppable

log = logging.getLogger(__name__)


def check_data(
    data: Annotated[Path, typer.Argument(help="A wheel-rig set or a drive log: folder with rig.toml or drive.toml.")],
    similarity: Annotated[
        bool,
        typer.Option(
            "--similarity", help="Write the dimensionless groups on which the channels of a rig set collapse."
        ),
    ] = False,
    trust: Trusted = False,
    out: Out = Path("out/check_data"),
    as_json: AsJson = False,
) -> None:
    """Check measured data as close-loop does, without a fit. Units, signs, ranges, gaps, clock, excitation."""
    from rover_pin.loop.data_check import check_data as check

    data_check = check(data, Trust(everything=trust))
    # Data that are too poor for the loop are no error: the report is the result of this command.
    verdict = (
        f"too poor: {data_check.too_poor}"
        if data_check.too_poor
        else "can be used: rover-pin close-loop is the next step"
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
