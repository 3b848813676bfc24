"""From a URDF to a rover: read it (xacro too), propose its TOML, write both and a picture, and check the result."""

from dataclasses import dataclass
from pathlib import Path

from rover_pin.base.errors import MissingExtraError, UrdfError
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.trust import Trust
from rover_pin.rover.description.structure import missing_links
from rover_pin.rover.description.tree import read_tree, urdf_text
from rover_pin.rover.proposal.parts import Proposal
from rover_pin.rover.proposal.picture import write_picture
from rover_pin.rover.proposal.propose import propose
from rover_pin.rover.proposal.toml import proposed_text
from rover_pin.rover.rover import load_rover
from rover_pin.rover.urdf_check import UrdfReport, check_urdf


@dataclass(frozen=True)
class NewRover:
    """What was proposed and written, and what a check says of it."""

    proposal: Proposal
    files: tuple[Path, ...]
    report: UrdfReport


def new_rover(urdf: str | Path, out: str | Path | None = None, trust: Trust = Trust()) -> NewRover:
    """Propose the TOML of a rover's URDF and write it, with a picture; nothing is asked, every guess is marked.

    Parameters
    ----------
    urdf : path
        A URDF, or a .xacro, which is expanded into a URDF beside `out`.
    out : path, optional
        The TOML to write; beside the URDF, by its name, if not given. The picture is called the same, with .png.
    trust : Trust
        A .xacro may run code (its ${} are Python), and so needs `Trust(everything=True)`.

    Raises
    ------
    UrdfError
        No URDF, a TOML that is already there, or no two axles of wheels in it.
    MissingExtraError
        A .xacro without the extra that expands it.
    """
    source = Path(urdf)
    if not is_file(source):
        raise UrdfError(f"{source}: there is no such file; give a rover's .urdf or .xacro.")
    stem = source.name.split(".")[0]
    toml = Path(out) if out is not None else source.with_name(f"{stem}.toml")
    if toml.suffix != ".toml" or is_file(toml):
        why = "is already there" if is_file(toml) else "is no .toml"
        raise UrdfError(f"{toml}: {why}; give another file with --out, nothing of yours is written over.")
    content = _content(source, trust)
    tree = read_tree(content, source.name)
    for fault in (fault for joint in tree.joints for fault in missing_links(tree, joint)):
        raise UrdfError(f"{source.name}: {fault}")
    proposal = propose(tree, source.parent)
    files = []
    beside = toml.with_name(f"{stem}.urdf")
    if not (is_file(beside) and beside.resolve() == source.resolve()):
        if is_file(beside):
            raise UrdfError(f"{beside}: is already there; give another folder with --out.")
        files.append(replace_file(beside, content))
    files.append(replace_file(toml, proposed_text(proposal, stem, beside.name)))
    report = check_urdf(toml)
    if report.loads:
        files.append(write_picture(load_rover(toml), toml.with_suffix(".png")))
    return NewRover(proposal, tuple(files), report)


def _content(source: Path, trust: Trust) -> str:
    if source.suffix != ".xacro":
        return urdf_text(source)
    if not trust.everything:
        raise UrdfError(f"{source.name}: a .xacro can run code and read other files: look at it, then say --trust.")
    try:
        from xacrodoc import XacroDoc
    except ImportError as error:
        raise MissingExtraError(
            f"{source.name}: a .xacro needs the package xacrodoc: pip install 'rover_pin[xacro]', or expand it first."
        ) from error
    try:
        return str(XacroDoc.from_file(str(source)).to_urdf_string())
    except Exception as error:
        why = getattr(error, "exc", None) or error  # xacro says it twice, what went wrong below it once
        raise UrdfError(f"{source.name}: xacro cannot expand it ({why}); expand it where its packages are.") from error
