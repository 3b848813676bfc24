"""The program's log for the options `-q` and `-v`, its version, its help, and its errors about unknown words."""

import copy
import logging
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from rover_pin.base.console import say
from rover_pin.base.encode import printable
from rover_pin.base.errors import ParameterError, closest
from rover_pin.version import __version__

USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]
"""The exception that typer raises for words that it cannot parse. It is taken from a subclass, because the module that
defines the exception depends on the version of typer."""
LEVELS = {"quiet": logging.WARNING, "": logging.INFO, "verbose": logging.DEBUG}
"""Level of detail that `speak` accepts -> the lowest level of the messages that are printed."""
GROUPS = {
    "Drive a rover": "drive map view watch sweep export",
    "Learn from measurements": "check-data close-loop identify compare improve import-log init demo",
    "Control": "bounds curve tune export-c export-fmu export-mjcf",
    "Add your own": "new-rover check-urdf new-effect",
    "Look up": "list",
}
"""Heading in the help of the program -> the commands under this heading. The headings are the tasks of a user."""


class LineFormatter(logging.Formatter):
    """Formats each record of the log as one line.

    A message of level INFO is printed alone, a warning gets a prefix, and a debug message (option -v) gets its time and
    module.
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the line for one record of the log."""
        message = printable(record.getMessage())
        if record.levelno >= logging.WARNING:
            return f"rover-pin: warning: {message}"
        if record.levelno >= logging.INFO:
            return message
        return f"{record.relativeCreated / 1e3:8.2f} s  {record.name.removeprefix('rover_pin.')}: {message}"


def speak(level: str = "") -> None:
    """Print the package's log on standard error from now on.

    The `level` "quiet" prints only warnings, the empty `level` prints also progress, and "verbose" prints everything.
    """
    log = logging.getLogger("rover_pin")
    # A handler of an earlier call would print every line twice.
    for old_handler in [
        old_handler for old_handler in log.handlers if isinstance(old_handler.formatter, LineFormatter)
    ]:
        log.removeHandler(old_handler)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter())
    log.addHandler(handler)
    log.setLevel(LEVELS[level])


class Program(TyperGroup):
    """The program as a group of commands. A user may write the options `-q` and `-v` before or after the command."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        shared = [copy.copy(parameter) for parameter in self.params if parameter.name in LEVELS]
        # The options take effect by their callbacks, so no command gets them as arguments.
        for option in shared:
            option.expose_value = False
        for command in self.commands.values():
            command.params = [*command.params, *shared]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of commands in the help of the program, in groups with one common column width."""
        width = max(map(len, self.commands))
        for title, names in GROUPS.items():
            help_lines = {name: self.commands[name].get_short_help_str(formatter.width) for name in names.split()}
            with formatter.section(title):
                formatter.write_dl([(f"{name:{width}}", help_line) for name, help_line in help_lines.items()])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command whose name is the first word of the command line.

        Raises ParameterError: no command has this name.
        """
        if args[0] not in self.commands and not args[0].startswith("-"):
            raise ParameterError(f"There is no command '{args[0]}'; {closest(args[0], self.commands)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that the command line names.

        Raises ParameterError: the command cannot parse a word of the line.
        """
        try:
            return super().invoke(ctx)
        except USAGE_ERROR as usage:
            error: Any = usage
            # The most frequent error is a setting that was written as an option: `--soil.k` instead of `--set soil.k=`.
            # Only commands with --set have settings.
            name = getattr(error, "option_name", "").lstrip("-").replace("-", "_")
            if name and error.ctx and any("--set" in parameter.opts for parameter in error.ctx.command.params):
                from rover_pin.cli.completing import settings_to_set

                if any(completion == f"{name}=" for completion, _ in settings_to_set(error.ctx, name)):
                    text = (
                        f"{error.option_name} is not an option of {error.ctx.info_name} but a setting: write --set "
                        f"{name}=..."
                    )
                    raise ParameterError(text) from None
            # typer's message may have several lines; an error of this program is one line.
            message = " ".join(error.format_message().split()).rstrip(".")
            hint = f"; rover-pin {error.ctx.info_name} --help lists all options" if error.ctx else ""
            raise ParameterError(f"{message}{hint}.") from None


def _print_version(flag: bool) -> None:
    """Print the version and end the program if the option `--version` was given (`flag`)."""
    if flag:
        say(f"rover-pin {__version__}")
        raise typer.Exit


def _set_quiet(flag: bool) -> bool:
    """Print only warnings from now on if the option `-q` was given (`flag`)."""
    if flag:
        speak("quiet")
    return flag


def _set_verbose(flag: bool) -> bool:
    """Also print details such as compilation steps from now on if the option `-v` was given (`flag`)."""
    if flag:
        speak("verbose")
    return flag


Quiet = Annotated[bool, typer.Option("-q", "--quiet", callback=_set_quiet, help="Print no progress, only warnings.")]
Verbose = Annotated[
    bool, typer.Option("-v", "--verbose", callback=_set_verbose, help="Also print details, such as compilation steps.")
]
Version = Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")]


def program(quiet: Quiet = False, verbose: Verbose = False, version: Version = False) -> None:
    """Handle the options of the program itself. Without -q and -v, warnings and progress are printed."""
    if not (quiet or verbose):
        speak()
