"""Propose and write the TOML of a new rover for its URDF or xacro file, draw the rover, and check the result."""

import math
from dataclasses import dataclass
from pathlib import Path, PurePath

from rover_pin.base.encode import comment, shell_word, toml_string
from rover_pin.base.errors import MissingExtraError, ParameterError, UrdfError, closest
from rover_pin.base.extras import install_command
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.toml_file import toml_key
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.trust import Trust
from rover_pin.contact import Wheel
from rover_pin.rover.description.tree import read_tree, urdf_text
from rover_pin.rover.proposal.frames import AXES
from rover_pin.rover.proposal.parts import Proposal
from rover_pin.rover.proposal.picture import write_picture
from rover_pin.rover.proposal.propose import propose
from rover_pin.rover.proposal.wheel_shape import WheelSize
from rover_pin.rover.rover import load_rover
from rover_pin.rover.urdf_check import UrdfReport, check_urdf


@dataclass(frozen=True)
class NewRover:
    """Result of `new_rover`: the proposal, the files that were written, and the report of `check_urdf` on these
    files.
    """

    proposal: Proposal
    files: tuple[Path, ...]
    report: UrdfReport


def new_rover(
    urdf: str | Path,
    out: str | Path | None = None,
    trust: Trust = Trust(),
    *,
    front: str = "",
    r: float | None = None,
    b: float | None = None,
) -> NewRover:
    """Propose the TOML for a rover's URDF, and write it together with a picture of the rover. Every guess is marked in
    the TOML.

    Parameters
    ----------
    urdf : path
        A URDF, or a .xacro file, which is expanded into a URDF next to `out`.
    out : path, optional
        The TOML to write; by default it is written next to the URDF with the URDF's name. A name without .toml gets
        this suffix, and a folder gets a file with the URDF's name. The picture has the name of the TOML with .png.
    trust : Trust
        A .xacro file needs `Trust(everything=True)`, because its expressions `${...}` are Python code that runs.
    front : str, optional
        The axis of the base link that points forward: +x, -x, +y, -y, +z or -z. By default the names of the wheels
        decide.
    r, b : float, optional
        Radius and width of all wheels [m]. By default they are taken from the drawings of the wheels' links, or from
        the links' inertia.

    Returns
    -------
    NewRover
        The proposal, the files that were written, and the report of the check.

    Raises
    ------
    UrdfError
        The file is no URDF, the TOML exists already, the URDF has fewer than two axles of wheels, or its names, axes
        and drawings contradict each other.
    ParameterError
        `front` is no axis, or only one of r and b is given.
    MissingExtraError
        The file is a .xacro file, and the package that expands it is not installed.

    Examples
    --------
    >>> result = new_rover("my_rover.urdf")  # doctest: +SKIP
    >>> result.report.ok  # doctest: +SKIP
    True
    """
    # All names and numbers are checked before a file is written.
    source = Path(urdf)
    if not is_file(source):
        raise UrdfError(f"{source}: there is no such file. Give the .urdf or .xacro file of a rover.")
    stem = source.name.split(".")[0]
    toml = Path(out) if out is not None else source.with_name(f"{stem}.toml")
    if toml.suffix == "":
        toml = toml / f"{stem}.toml" if toml.is_dir() else toml.with_name(f"{toml.name}.toml")
    if toml.suffix != ".toml" or is_file(toml):
        reason = "the file exists already" if is_file(toml) else "the file is no .toml"
        raise UrdfError(f"{toml}: {reason}. Give another file with --out; no existing file is overwritten.")
    if front and front not in AXES:
        raise ParameterError(f"front = {front!r} is not known: {closest(front, AXES)}")
    if (r is None) != (b is None):
        raise ParameterError("r and b, the radius and the width of the wheels, belong together: give both or neither.")
    size = None if r is None or b is None else WheelSize(float(Wheel(r=r, b=b).r), float(b), "the size that was given")
    content = _content(source, trust)
    proposal = propose(read_tree(content, source.name), source.parent, front, size)
    # The TOML names the URDF without a folder, so the URDF must lie next to the TOML.
    files = []
    beside = toml.with_name(f"{stem}.urdf")
    if not (is_file(beside) and beside.resolve() == source.resolve()):
        if is_file(beside):
            raise UrdfError(f"{beside}: the file exists already. Give another folder with --out.")
        files.append(replace_file(beside, content))
    files.append(replace_file(toml, proposed_text(proposal, stem, beside.name)))
    # The proposal is checked as a user's TOML would be, so that its faults are reported with it.
    report = check_urdf(toml)
    # A rover that does not load cannot be drawn.
    if report.loads:
        files.append(write_picture(load_rover(toml), toml.with_suffix(".png")))
    return NewRover(proposal, tuple(files), report)


def _content(source: Path, trust: Trust) -> str:
    """Return the text of a URDF file, or the URDF into which xacro expands a .xacro file. For the errors, see
    `new_rover`.
    """
    if source.suffix != ".xacro":
        return urdf_text(source)
    if not trust.everything:
        raise UrdfError(
            f"{source.name}: a .xacro file can run code and read other files. Read the file first, then give --trust."
        )
    try:
        import xacro
        from xacrodoc import XacroDoc, packages
    except ImportError as error:
        raise MissingExtraError(
            f"{source.name}: a .xacro file needs the package xacrodoc. Run `{install_command('xacro')}`, or expand the "
            "file first."
        ) from error
    try:
        # xacro gets the path of the file instead of its text, because it looks for an include next to the including
        # file.
        packages.walk_up_from(source)
        return str(XacroDoc(xacro.process_file(str(source.absolute()), mappings={})).to_urdf_string())
    except Exception as error:
        reason = getattr(error, "exc", None) or error  # xacro wraps the error that has the reason
        raise UrdfError(
            f"{source.name}: xacro cannot expand the file ({reason}). Expand it on a computer that has its packages."
        ) from error


def proposed_text(proposal: Proposal, name: str, urdf: str) -> str:
    """Return the text of the TOML for a proposal.

    A comment marks every guess as GUESSED and states its reason.

    Parameters
    ----------
    proposal : Proposal
        The proposed roles of the joints.
    name, urdf : str
        Name of the rover, and name of its URDF file.
    """
    command = f"rover-pin new-rover {comment(shell_word(PurePath(urdf)))}"
    lines = [
        f"# Proposed by `{command}`. The URDF does not state the parts marked GUESSED: check them.",
        "",
        f"name = {toml_string(name)}",
        f"urdf = {toml_string(urdf)}",
        f"base = {toml_string(proposal.base)}",
    ]
    if any(proposal.base_rpy):
        angles = ", ".join(f"{angle:.10g}" for angle in proposal.base_rpy)
        lines.append(f"base_rpy = [{angles}]  # GUESSED: the base's axes are {comment(proposal.reasons['base_rpy'])}")
    if proposal.cut:
        cut_joints = ", ".join(map(toml_string, proposal.cut))
        lines.append(f"cut = [{cut_joints}]  # {comment(proposal.reasons[proposal.cut[0]])}")
    if proposal.skid:
        lines.append(
            "# The rover has no steering: it turns by the speeds of its sides. If belts or gears join the wheels"
        )
        lines.append("# of a side:")
        lines.append("# tied_sides = true")

    # Wheels and their sizes. [wheel] has the size of the first axle; an axle gets a table if its size differs by 2 %.
    lines.append("\n[wheels]  # GUESSED from axis, place and shape; axles from front to rear, joints left and right")
    lines.append(f"# {comment(proposal.reasons['front'])}")
    for axle in proposal.axles:
        lines.append(f"{axle.name} = [{toml_string(axle.wheels[0].joint)}, {toml_string(axle.wheels[1].joint)}]")
    size_by_axle = {axle.name: axle.wheels[0].size for axle in proposal.axles}
    default_size = next(iter(size_by_axle.values()))
    tables = [("wheel]  # radius and width in metres", default_size)]
    for axle_name, size in size_by_axle.items():
        is_default = [math.isclose(a, b, rel_tol=0.02) for a, b in zip(size[:2], default_size[:2], strict=True)]
        if not all(is_default):
            tables.append((f"wheel.{axle_name}]", size))
    for head, size in tables:
        lines += [f"\n[{head}", f"r = {size.r:.4g}  # GUESSED from {comment(size.source)}", f"b = {size.b:.4g}"]
    steered = [axle for axle in proposal.axles if axle.steering]
    if steered:
        lines.append("\n[steering]  # GUESSED: each turns one wheel about an upright axis")
        for axle in steered:
            left, right = axle.steering or ("", "")
            lines.append(f"{axle.name} = [{toml_string(left)}, {toml_string(right)}]")

    if proposal.suspension:
        lines.append(
            "\n[suspension]  # GUESSED from the wheels that joints carry: pairs left and right, or one in the middle"
        )
        for pivot, joints in proposal.suspension.items():
            reason = proposal.reasons.get(joints[0], "")
            names = [toml_string(joint) for joint in joints]
            value = names[0] if len(names) == 1 else f"[{names[0]}, {names[1]}]"
            lines.append(f"{toml_key(pivot)} = {value}" + (f"  # {comment(reason)}" if reason else ""))
        if proposal.differential:
            lines.append(f"\n[differential]  # GUESSED: {comment(proposal.reasons['differential'])}")
            lines.append(f"pair = {toml_string(proposal.differential)}")
    if proposal.coupled:
        lines.append("\n[coupled]  # GUESSED: joints that follow another")
        for joint, (leader, ratio) in proposal.coupled.items():
            entry = f"{{ joint = {toml_string(leader)}, ratio = {ratio:g} }}"
            lines.append(f"{toml_key(joint)} = {entry}  # {comment(proposal.reasons[joint])}")
    if proposal.held_joints:
        lines.append("\n[held]  # GUESSED: joints that are fixed, at an angle [rad] or a travel [m]")
        for joint, rest in proposal.held_joints.items():
            lines.append(f"{toml_key(joint)} = {rest:.6g}  # {comment(proposal.reasons[joint])}")

    # Tables that a user may add, as comments.
    lines.append(
        "\n# The motor of a wheel, from its data sheet. Without this table the motor is sized by the rover's weight:"
    )
    lines.append("# [motor]")
    lines.append('# stall_torque = { value = 1.0, unit = "N m" }')
    lines.append('# no_load_speed = { value = 30, unit = "rpm" }')
    lines.append("# gear = 1.0\n# efficiency = 1.0")
    lines.append(
        "\n# The soil of a drive that states no other soil. Without this key it is slope-sand, made firm enough:"
    )
    lines.append('# soil = "fjs-1"')
    return "\n".join(lines) + "\n"
