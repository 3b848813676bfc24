"""`rover-pin new-rover`: propose the TOML of a URDF."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.options import AsJson
from rover_pin.cli.terminal import report


def new_rover(
    urdf: Annotated[Path, typer.Argument(help="A rover's .urdf, or a .xacro.")],
    out: Annotated[Path | None, typer.Option("--out", help="The TOML to write; beside the URDF.")] = None,
    trust: Annotated[bool, typer.Option("--trust", help="Let a .xacro run the code that it holds.")] = False,
    as_json: AsJson = False,
) -> None:
    """Propose which joint of a URDF plays which part. Writes its TOML, every guess marked, and a picture with names."""
    from rover_pin.base.trust import Trust
    from rover_pin.rover.proposal.new_rover import new_rover as propose

    result = propose(urdf, out, Trust(everything=trust))
    proposal = result.proposal
    wheels = {axle.name: " ".join(wheel.joint for wheel in axle.wheels) for axle in proposal.axles}
    steering = {axle.name: " ".join(axle.steering) for axle in proposal.axles if axle.steering}
    size = proposal.axles[0].wheels[0].size
    facts = {
        "wheels": wheels,
        "wheel": f"r = {size.r:.3g} m, b = {size.b:.3g} m, from {size.source}",
        "steering": steering or "none: it turns by its sides' speeds",
        "suspension": {name: " ".join(joints) for name, joints in proposal.suspension.items()} or "none",
        "differential": proposal.differential or "none",
        "coupled": {joint: f"{ratio:+g} {leader}" for joint, (leader, ratio) in proposal.coupled.items()} or "none",
        "held": ", ".join(proposal.held_joints) or "none",
        "faults": list(result.report.faults),
        "files": [str(file) for file in result.files],
    }
    toml = next(file for file in result.files if file.suffix == ".toml")
    facts["next"] = f"look at what is marked GUESSED, then: rover-pin check-urdf {toml}"
    report(facts, as_json)
    if not result.report.ok:
        raise typer.Exit(1)
