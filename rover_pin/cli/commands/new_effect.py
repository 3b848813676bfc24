"""`rover-pin new-effect`, `new-rover`: files to begin with, an effect and its test, or the TOML of a rover."""

import re
from enum import StrEnum
from pathlib import Path
from string import Template
from typing import Annotated

import typer

from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import exists
from rover_pin.cli.options import AsJson
from rover_pin.cli.terminal import report


class Acts(StrEnum):
    """Where an effect acts."""

    CONTACT = "contact"
    MOTOR = "motor"
    BODY = "body"


def new_effect(
    name: Annotated[str, typer.Argument(help="The class's name, as StickySoil.")],
    acts: Annotated[Acts, typer.Option(help="Where it acts.")] = Acts.CONTACT,
    out: Annotated[Path, typer.Option("--out", help="Folder for the two files.")] = Path("."),
    as_json: AsJson = False,
) -> None:
    """Write an effect of your own to start from, and its test. The test says whether it keeps the contract."""
    from importlib.resources import files

    from rover_pin.base.files.whole_file import replace_file

    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise ParameterError(f"'{name}' is no name of an effect: write it as a class's, as StickySoil.")
    stem = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    kinds = {f"{stem}.py": acts.value, f"test_{stem}.py": "test"}
    for file in kinds:
        if exists(out / file):
            raise ParameterError(f"{out / file}: there is one already: take another name, or another folder by --out.")
    folder = files("rover_pin.cli.commands") / "templates"
    texts = {file: Template((folder / f"{kind}.txt").read_text(encoding="utf-8")) for file, kind in kinds.items()}
    paths = [
        str(replace_file(out / file, text.substitute(Name=name, file=f"{stem}.py"))) for file, text in texts.items()
    ]
    then = [f"pytest {paths[1]}", f"rover-pin close-loop DATA --effects {paths[0]}"]
    report({"files": paths, "next": then}, as_json)


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
