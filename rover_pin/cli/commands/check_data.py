"""`rover-pin check-data`: whether measured data can be used, and what they lack, in seconds."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Out, Trusted
from rover_pin.cli.terminal import report, stoppable

log = logging.getLogger(__name__)


def check_data(
    data: Annotated[Path, typer.Argument(help="A wheel-rig set or a drive log: folder with rig.toml or drive.toml.")],
    similarity: Annotated[
        bool, typer.Option("--similarity", help="Write on which dimensionless groups a rig set's channels collapse.")
    ] = False,
    trust: Trusted = False,
    out: Out = Path("out/check_data"),
    as_json: AsJson = False,
) -> None:
    """Check measured data as close-loop would, and fit nothing. Units, signs, ranges, gaps, clock, excitation."""
    from rover_pin.loop.data_check import check_data as check

    data_check = check(data, Trust(everything=trust))
    verdict = (
        f"too poor: {data_check.too_poor}"
        if data_check.too_poor
        else "can be used: rover-pin close-loop goes on from here"
    )
    result = {
        "data": str(data),
        "kind": data_check.kind,
        "holds": data_check.holds,
        "verdict": verdict,
        "findings": list(map(str, data_check.findings)),
    }
    if similarity:
        with stoppable(out, ("similarity.csv", "similarity.png")), alone_in(out):
            result |= _similarity(data, Trust(everything=trust), out)
    report(result, as_json)


def _similarity(data: Path, trust: Trust, out: Path) -> dict[str, list[str]]:
    """Write the files of a set's similarity, and return in words what its channels collapse on."""
    from rover_pin.experiments.wheel_rig.similarity import collapses, simplest
    from rover_pin.loop.data_check import rig_set_in
    from rover_pin.plot.similarity import similarity_figure

    rig_set = rig_set_in(data, trust)
    rows = collapses(rig_set, lambda message: log.info("%s", message))
    files = similarity_figure(rig_set, rows, out)
    return {"similarity": [row.sentence for row in simplest(rows).values()], "files": list(map(str, files))}
