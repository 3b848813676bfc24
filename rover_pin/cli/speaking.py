"""What a command says: on its way by `-q`, `-v` and `--version`, which all take, and of words that it cannot take."""

import copy
import logging
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from rover_pin.base.errors import ParameterError, closest
from rover_pin.version import __version__

MISTYPED: type[Exception] = typer.BadParameter.__mro__[1]
"""What the command line's library raises of words that it cannot take; its module depends on the version."""
LEVELS = {"quiet": logging.WARNING, "": logging.INFO, "verbose": logging.DEBUG}


GROUPS = {
    "Drive a rover": "drive map view watch sweep export",
    "Learn from measurements": "check-data close-loop identify compare improve import-log init demo",
    "Control": "bounds curve tune export-c export-fmu export-mjcf",
    "Add your own": "new-rover check-urdf new-effect",
    "Look up": "list",
}
"""Commands as the program's help has them, by what people do."""


class Lines(logging.Formatter):
    """One line a record: a plain one as it is, a warning as the program's, one of `-v` with its module and time."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        message = record.getMessage()
        if record.levelno >= logging.WARNING:
            return f"rover-pin: warning: {message}"
        if record.levelno >= logging.INFO:
            return message
        return f"{record.relativeCreated / 1e3:8.2f} s  {record.name.removeprefix('rover_pin.')}: {message}"


def speak(level: str = "") -> None:
    """Say the package's log on standard error from this level on: quiet, verbose, or what is usual."""
    log = logging.getLogger("rover_pin")
    for old_handler in [old_handler for old_handler in log.handlers if isinstance(old_handler.formatter, Lines)]:
        log.removeHandler(old_handler)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(Lines())
    log.addHandler(handler)
    log.setLevel(LEVELS[level])


class Speaking(TyperGroup):
    """A program whose commands all take its own `-q` and `-v`, wherever one writes them."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        shared = [copy.copy(parameter) for parameter in self.params if parameter.name in LEVELS]
        for option in shared:
            option.expose_value = False
        for command in self.commands.values():
            command.params = [*command.params, *shared]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in their groups, as wide in each."""
        width = max(map(len, self.commands))
        for title, names in GROUPS.items():
            help_lines = {name: self.commands[name].get_short_help_str(formatter.width) for name in names.split()}
            with formatter.section(title):
                formatter.write_dl([(f"{name:{width}}", help_line) for name, help_line in help_lines.items()])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the first word names.

        Raises ParameterError: it names none.
        """
        if args[0] not in self.commands and not args[0].startswith("-"):
            raise ParameterError(f"There is no command '{args[0]}'; {closest(args[0], self.commands)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command.

        Raises ParameterError: a word that it cannot take, in one sentence.
        """
        try:
            return super().invoke(ctx)
        except MISTYPED as error:
            raise ParameterError(_refusal(error)) from None


def _refusal(error: Any) -> str:
    meant = _setting_meant(error)
    if meant:
        return f"{error.option_name} is no option of {error.ctx.info_name} but a setting: --set {meant}=..."
    message = " ".join(error.format_message().split()).rstrip(".")
    return f"{message}; rover-pin {error.ctx.info_name} --help lists what it takes." if error.ctx else f"{message}."


def _setting_meant(error: Any) -> str:
    """Return the name of the setting that was written as an option, or nothing."""
    name = getattr(error, "option_name", "").lstrip("-").replace("-", "_")
    if not name or not error.ctx or not any("--set" in parameter.opts for parameter in error.ctx.command.params):
        return ""
    from rover_pin.cli.completing import settings_to_set

    return name if any(completion == f"{name}=" for completion, _ in settings_to_set(error.ctx, name)) else ""


def _say_version(flag: bool) -> None:
    if flag:
        print(f"rover-pin {__version__}")
        raise typer.Exit


def _say_less(flag: bool) -> bool:
    if flag:
        speak("quiet")
    return flag


def _say_more(flag: bool) -> bool:
    if flag:
        speak("verbose")
    return flag


Quiet = Annotated[bool, typer.Option("-q", "--quiet", callback=_say_less, help="Say only warnings on the way.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", callback=_say_more, help="Say also what is compiled, when.")]
Version = Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version.")]


def program(quiet: Quiet = False, verbose: Verbose = False, version: Version = False) -> None:
    """Take the options of the program itself."""
    if not (quiet or verbose):
        speak()
