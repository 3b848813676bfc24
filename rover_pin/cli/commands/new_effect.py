"""`rover-pin new-effect`, `new-rover`: write the first files of a user's own effect (with its test) or own rover."""

import re
from enum import StrEnum
from pathlib import Path
from string import Template
from typing import Annotated

import typer

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import exists
from rover_pin.cli.options import AsJson, NamedOut, Out, Radius, Trusted, Width
from rover_pin.cli.terminal import report


class Acts(StrEnum):
    """The parts of the rover on which a new effect can act."""

    CONTACT = "contact"
    MOTOR = "motor"
    BODY = "body"


def new_effect(
    name: Annotated[str, typer.Argument(help="Class name of the effect, such as StickySoil.")],
    acts: Annotated[
        Acts, typer.Option(help="Part of the rover on which the effect acts: wheel contact, motor or body.")
    ] = Acts.CONTACT,
    out: Out = Path("."),
    as_json: AsJson = False,
) -> None:
    """Write a first version of your own effect, and a test that checks what every effect must fulfil."""
    from importlib.resources import files

    from rover_pin.base.files.whole_file import replace_file
    from rover_pin.simulation.model.effect_source import first_version

    # The name becomes the name of a class in the file, so it must be an identifier.
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise ParameterError(f"'{name}' cannot be the name of an effect: give a class name, for example StickySoil.")
    # StickySoil becomes sticky_soil.
    stem = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    test = Template((files("rover_pin.cli.commands") / "test_of_new_effect.txt").read_text(encoding="utf-8"))
    texts = {
        out / f"{stem}.py": first_version(name, acts.value).text,
        out / f"test_{stem}.py": test.substitute(Name=name, file=f"{stem}.py"),
    }
    # Neither file is written if one of them exists, so that an effect never gets the test of another effect.
    for file in texts:
        if exists(file):
            raise ParameterError(
                f"{file}: this file exists already: take another name, or name another folder with --out."
            )
    paths = [str(replace_file(file, text)) for file, text in texts.items()]
    then = [f"pytest {shell_word(Path(paths[1]))}", f"rover-pin close-loop DATA --effects {shell_word(Path(paths[0]))}"]
    report({"files": paths, "next": then}, as_json)


def new_rover(
    urdf: Annotated[Path, typer.Argument(help="URDF of the rover (.urdf or .xacro).")],
    out: NamedOut = None,
    front: Annotated[
        str,
        typer.Option(
            metavar="AXIS",
            help="Axis of the base link that points forward, such as -x; by default the names of the wheels decide.",
        ),
    ] = "",
    radius: Radius = "",
    width: Width = "",
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Propose the rover's TOML file for a URDF. The proposal states which joints are wheels, steering or suspension.

    Every guess in the TOML file is marked, and a picture shows the rover with the names of its links. By default, the
    files are written next to the URDF. Exit code 1: the rover has faults.
    """
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.base.trust import Trust
    from rover_pin.rover.proposal.new_rover import new_rover as propose

    # Without --r and --b, the wheel's size is taken from the shapes in the URDF.
    r, b = (parse_quantity(text, "m", name) if text else None for name, text in (("--r", radius), ("--b", width)))
    result = propose(urdf, out, Trust(everything=trust), front=front, r=r, b=b)
    # The table lists all guesses, because the user must check each of them.
    proposal = result.proposal
    wheels = {axle.name: " ".join(wheel.joint for wheel in axle.wheels) for axle in proposal.axles}
    steering = {axle.name: " ".join(axle.steering) for axle in proposal.axles if axle.steering}
    size = proposal.axles[0].wheels[0].size
    facts = {
        "wheels": wheels,
        "wheel": f"r = {size.r:.3g} m, b = {size.b:.3g} m, from {size.source}",
        "steering": steering or "none: the rover turns by different speeds of its two sides",
        "suspension": {name: " ".join(joints) for name, joints in proposal.suspension.items()} or "none",
        "differential": proposal.differential or "none",
        "coupled": {joint: f"{ratio:+g} {leader}" for joint, (leader, ratio) in proposal.coupled.items()} or "none",
        "held": ", ".join(proposal.held_joints) or "none",
        "faults": list(result.report.faults),
        "files": [str(file) for file in result.files],
    }
    toml = next(file for file in result.files if file.suffix == ".toml")
    facts["next"] = f"check the parts marked GUESSED, then: rover-pin check-urdf {shell_word(toml)}"
    report(facts, as_json)
    # The files are written in spite of the faults, so that the user can mend them; the exit code reports the faults.
    if not result.report.ok:
        raise typer.Exit(1)
