"""`rover-pin new-effect`: the file of an effect of one's own, which runs as it stands, and the test of its contract."""

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

    from rover_pin.base.files.columns import replace_file

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
