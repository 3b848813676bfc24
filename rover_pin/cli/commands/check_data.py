"""`rover-pin check-data`: whether measured data can be used, and what they lack, in seconds."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.trust import Trust
from rover_pin.cli.commands.options import AsJson, Trusted
from rover_pin.cli.terminal import report


def check_data(
    data: Annotated[Path, typer.Argument(help="A wheel-rig set or a drive log: folder with rig.toml or drive.toml.")],
    trust: Trusted = False,
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
    findings = list(map(str, data_check.findings))
    report(
        {
            "data": str(data),
            "kind": data_check.kind,
            "holds": data_check.holds,
            "verdict": verdict,
            "findings": findings,
        },
        as_json,
    )
