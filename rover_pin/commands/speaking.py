"""What a command says: on its way by `-q`, `-v` and `--version`, which all take, and of words that it cannot take."""

import copy
import logging
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from rover_pin.errors import ParameterError, closest
from rover_pin.version import __version__

MISTYPED: type[Exception] = typer.BadParameter.__mro__[1]
"""What the command line's library raises of words that it cannot take; which module it is in hangs on the version."""
LEVELS = {"quiet": logging.WARNING, "": logging.INFO, "verbose": logging.DEBUG}


class Lines(logging.Formatter):
    """One line a record: a plain one as it is, a warning as the program's, one of `-v` with its module and time."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        said = record.getMessage()
        if record.levelno >= logging.WARNING:
            return f"rover-pin: warning: {said}"
        if record.levelno >= logging.INFO:
            return said
        return f"{record.relativeCreated / 1e3:8.2f} s  {record.name.removeprefix('rover_pin.')}: {said}"


def speak(level: str = "") -> None:
    """Say the package's log on standard error from this level on: quiet, verbose, or what is usual."""
    log = logging.getLogger("rover_pin")
    for each in [each for each in log.handlers if isinstance(each.formatter, Lines)]:
        log.removeHandler(each)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(Lines())
    log.addHandler(handler)
    log.setLevel(LEVELS[level])


class Speaking(TyperGroup):
    """A program whose commands all take its own `-q` and `-v`, wherever one writes them."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        shared = [copy.copy(each) for each in self.params if each.name in LEVELS]
        for option in shared:
            option.expose_value = False
        for command in self.commands.values():
            command.params = [*command.params, *shared]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the first word names.

        Raises
        ------
        ParameterError
            It names none.
        """
        if args[0] not in self.commands and not args[0].startswith("-"):
            raise ParameterError(f"There is no command '{args[0]}'; {closest(args[0], self.commands)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command.

        Raises
        ------
        ParameterError
            A word that it cannot take, in one sentence.
        """
        try:
            return super().invoke(ctx)
        except MISTYPED as error:
            raise ParameterError(_refused(error)) from None


def _refused(error: Any) -> str:
    meant = _setting_meant(error)
    if meant:
        return f"{error.option_name} is no option of {error.ctx.info_name} but a setting: --set {meant}=..."
    said = " ".join(error.format_message().split()).rstrip(".")
    return f"{said}; rover-pin {error.ctx.info_name} --help lists what it takes." if error.ctx else f"{said}."


def _setting_meant(error: Any) -> str:
    """Return the name of the setting that was written as an option, or nothing."""
    name = getattr(error, "option_name", "").lstrip("-").replace("-", "_")
    if not name or not error.ctx or not any("--set" in each.opts for each in error.ctx.command.params):
        return ""
    from rover_pin.commands.completing import settings_to_set

    return name if any(known == f"{name}=" for known, _ in settings_to_set(error.ctx, name)) else ""


def _say_version(given: bool) -> None:
    if given:
        print(f"rover-pin {__version__}")
        raise typer.Exit


def _say_less(given: bool) -> bool:
    if given:
        speak("quiet")
    return given


def _say_more(given: bool) -> bool:
    if given:
        speak("verbose")
    return given


Quiet = Annotated[bool, typer.Option("-q", "--quiet", callback=_say_less, help="Say only warnings on the way.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", callback=_say_more, help="Say also what is compiled, when.")]
Version = Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version.")]


def program(quiet: Quiet = False, verbose: Verbose = False, version: Version = False) -> None:
    """Take the options of the program itself."""
    if not (quiet or verbose):
        speak()
