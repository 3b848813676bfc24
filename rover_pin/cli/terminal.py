"""Input and output of the command line: values in options, tables, JSON, progress bars, and stops by Ctrl-C."""

from __future__ import annotations

import logging
import math
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rover_pin.base.console import plain_column, plain_console, say, warn
from rover_pin.base.encode import printable
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import exists
from rover_pin.base.files.results_folder import say_what_is_replaced
from rover_pin.base.jobs.workers import Terminated, ending_workers

if TYPE_CHECKING:
    from rover_pin.base.settings import Setting

log = logging.getLogger(__name__)


def priors(words: Iterable[str]) -> dict[str, Any]:
    """Read the words NAME=MEAN:SD of the option `--prior`, and return a dict from the name of a number to its prior.

    Raises ParameterError: a word has another form, or a number has a wrong unit.
    """
    from rover_pin.base.quantity import parse_quantity, quantities
    from rover_pin.contact import Soil, Wheel
    from rover_pin.estimation.parameter import Prior

    result, units = {}, {name: spec.unit for name, spec in (quantities(Soil) | quantities(Wheel)).items()}
    for word in words:
        name, _, value = word.partition("=")
        mean, sign, sd = value.partition(":")
        # Either both numbers have a unit or neither: the SD of 30deg:2 could be in degrees or in radians.
        bare = [text.strip()[-1:] in tuple("0123456789.") for text in (mean, sd)]
        if not sign or bare[0] != bare[1]:
            raise ParameterError(
                f"--prior {word}: write a prior as NAME=MEAN:SD, such as n=1.1:0.1 or phi=30deg:2deg, with a unit for "
                "both numbers or for neither."
            )
        # A number such as soil.phi has the unit of the field phi.
        where = f"--prior {word}: {name}"
        result[name] = Prior(
            *(parse_quantity(text, units.get(name.rpartition(".")[2], ""), where) for text in (mean, sd))
        )
    return result


def drive_settings(set_: list[str], **options: Any) -> dict[str, Any]:
    """Return the settings of a scenario from the option `--set` and from options such as `--soil`.

    `set_` are the words NAME=VALUE of `--set`. The dict omits options that were not given (empty values).

    Raises ParameterError: an option and a `--set` give different values to one setting.
    """
    # Empty values are options that the user did not give.
    given = {name: str(value) if isinstance(value, Path) else value for name, value in options.items() if value}
    settings = assignments(set_)
    for name in given.keys() & settings.keys():
        if str(given[name]) != str(settings[name]):
            raise ParameterError(
                f"--{name} {given[name]} and --set {name}={settings[name]} contradict each other: give only one."
            )
    return {**given, **settings}


def soil_and_wheel(set_: list[str], soil: Any, wheel: Any) -> tuple[dict[str, float], dict[str, float]]:
    """Return the numbers of the soil and the numbers of the wheel that the option `--set` states.

    Each is a dict from name to number in SI. A name without a dot, such as `phi`, is a number of the soil. `soil` and
    `wheel` are the records whose fields can be set.

    Raises ParameterError: a name is unknown, or a number is out of bounds or has a wrong unit.
    """
    from rover_pin.base.settings import Settings

    values = assignments(set_)
    request = Settings({name if "." in name else f"soil.{name}": value for name, value in values.items()})
    numbers = request.record("soil", soil), request.record("wheel", wheel)
    request.finish()
    return numbers


def formulas(words: Iterable[str]) -> dict[str, str]:
    """Return the words NAME=FORMULA of the option `--column` as a dict from column name to formula.

    Raises ParameterError: a word has another form, or a name is given twice.
    """
    columns: dict[str, str] = {}
    for word in words:
        name, equals, formula = word.partition("=")
        if not equals or name in columns:
            raise ParameterError(
                f"--column {word}: write a column as NAME=FORMULA, such as load_N='9.81 * m', once for each name."
            )
        columns[name] = formula
    return columns


def stages(is_silent: bool) -> Callable[[str, int, int], None]:
    """Return a function that logs the progress of each stage of a long calculation.

    The returned function takes the name of the stage, the number of finished parts, and the total number of parts. With
    `is_silent`, it does not log the end of a stage.
    """
    from rover_pin.base.jobs.time_left import TimeLeft

    # One estimate of the remaining time for each stage, which starts when the stage first reports.
    begun: dict[str, TimeLeft] = {}

    def say(name: str, done: int, total: int) -> None:
        begun.setdefault(name, TimeLeft(name)).note_done(done, total)
        if done == total:
            del begun[name]
            if not is_silent:
                log.info("%s: %d done", name, total)

    return say


def assignments(words: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Return the words NAME=VALUE of an option as a dict from name to value. A value that is a number becomes a float.

    Raises ParameterError: a word has no `=`. The message names the `option`.
    """
    values: dict[str, Any] = {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign:
            raise ParameterError(f"{option} {word}: write it as NAME=VALUE, such as {option} soil.k=0.01.")
        # A text that is no number keeps its unit or its word, and the setting itself converts it later.
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = value
    return values


@contextmanager
def stoppable(out: Path | None = None, replaced: Sequence[str] = (), untouched: Sequence[str] = ()) -> Iterator[None]:
    """Make Ctrl-C and SIGTERM end a command and its workers with one line that names the result files that are kept.

    Parameters
    ----------
    out : path
        Folder of the results.
    replaced : sequence of str
        Names of the files that the command writes into the folder. If files of an earlier run have these names, the log
        first states that they will be replaced.
    untouched : sequence of str
        Names of files that this command does not write. If files of an earlier run have these names, the log states
        that they are kept, because a user could take them for results of this run.
    """
    say_what_is_replaced(out, replaced, untouched)
    # A file counts as written by this run if its time of change differs from the time before the run.
    before = _times(out, replaced)
    try:
        with ending_workers():
            yield
    except (KeyboardInterrupt, Terminated) as stop:
        written = [name for name, time in _times(out, replaced).items() if before.get(name) != time]
        kept = f"kept in {out}: {', '.join(written)}" if written else "nothing is kept"
        # Calculations that can resume add a note on how to resume.
        message = "; ".join(getattr(stop, "__notes__", ())) or kept
        warn(f"rover-pin: stopped: {message}.")
        raise typer.Exit(128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT)) from None


def _times(out: Path | None, names: Sequence[str]) -> dict[str, int]:
    """Return the time of the last change [ns] of those files in a folder that exist, by file name."""
    files = {} if out is None else {name: out / name for name in names}
    return {name: file.stat().st_mtime_ns for name, file in files.items() if exists(file)}


def report(result: Mapping[str, Any], as_json: bool) -> None:
    """Print a result as a short table, or as one JSON object if `as_json` is True.

    A line of the table is never wrapped or shortened, because users copy paths from it.
    """
    if as_json:
        say(json_text(result))
        return
    # Names in the first column, padded to equal width; further lines of a value are aligned with its first line.
    lines = [(name.replace("_", " "), (format_result(value) or "none").split("\n")) for name, value in result.items()]
    width = max((len(name) for name, _ in lines), default=0)
    for name, (first, *more) in lines:
        say(f"{name:{width}}  {first}".rstrip())
        for line in more:
            say(f"{'':{width}}  {line}")


MAX_COLUMN_WIDTH = 28
"""Maximum width of a column of the table of settings, in letters. A longer cell is not cut; it shifts the rest of its
own row to the right. With three columns of 28 letters, the table usually fits into a terminal of 120 letters."""


def numbers_table(settings: Iterable[Setting]) -> None:
    """Print a table with one line for each setting: name, default with unit, bounds or choices, and source."""
    rows = [("name", "default", "allowed", "from")]
    rows += [
        (setting.name, format_value(setting.value, setting.unit), limits_of(setting), setting.source)
        for setting in settings
    ]
    # The widest cell decides the width of its column, up to a maximum.
    widths = [min(max(len(row[i]) for row in rows), MAX_COLUMN_WIDTH) for i in range(3)]
    for row in rows:
        cells = (f"{cell:{width}}" for cell, width in zip(row, widths, strict=False))
        say("  ".join([*cells, row[3]]).rstrip())


def fact(name: str, value: Any) -> str:
    """Return a fact as a line of text. If its name ends in a unit, the unit follows the value.

    For example, mass_kg = 5.8 gives "mass: 5.8 kg".
    """
    from rover_pin.base.units import UNITS

    words, _, unit = name.rpartition("_")
    has_unit = unit in UNITS and bool(words)  # "m" alone is a name, not a unit
    words = (words if has_unit else name).replace("_", " ")
    if isinstance(value, Mapping):
        text = ", ".join(f"{key} = {format_value(entry)}" for key, entry in value.items())
    else:
        text = (
            ", ".join(map(str, value))
            if isinstance(value, (list, tuple))
            else format_value(value, unit if has_unit else "")
        )
    return f"{words}: {text}"


def format_value(value: Any, unit: str = "") -> str:
    """Return a value as text: a number with six digits and its unit, and an angle also in degrees."""
    if value is None or value == ():
        return "none"
    # A tuple of numbers shares one unit, which follows the last number.
    if isinstance(value, tuple) and all(isinstance(number, (int, float)) for number in value):
        return f"{', '.join(f'{number:.6g}' for number in value)} {unit}".rstrip()
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    # Angles are in radians inside the package; degrees are added for the reader, but not for rates.
    degrees = f" = {math.degrees(value):.4g} {unit.replace('rad', 'deg')}" if unit.startswith("rad") and value else ""
    return f"{value:.6g} {unit}".rstrip() + (degrees if "/s" not in unit else "")


def limits_of(setting: Setting) -> str:
    """Return the choices or the bounds of a setting as text.

    The text is "any" for a number without bounds, and "-" for a setting that is not a number and has no choices.
    """
    if setting.choices:
        return ", ".join(setting.choices)
    low, high = (f"{bound:g}" if math.isfinite(bound) else "" for bound in (setting.low, setting.high))
    if low or high:
        return f"{low} .. {high}".strip()
    return "any" if isinstance(setting.value, float) else "-"


def json_text(result: Mapping[str, Any]) -> str:
    """Return a result as strict JSON. Strict JSON has no NaN and no infinity, so such numbers become null."""
    import json

    def strict(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {str(name): strict(entry) for name, entry in value.items()}
        if isinstance(value, (list, tuple)):
            return [strict(entry) for entry in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(strict(result), default=str, allow_nan=False)


def format_result(value: Any) -> str:
    """Return a value of a result as text for the terminal. A list gives one line for each entry."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {format_result(entry)}" for name, entry in value.items())
    if isinstance(value, (list, tuple)):
        return "\n".join(format_result(entry) for entry in value)
    return printable(str(value))


@contextmanager
def progress(what: str, total: float, silent: bool) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on the terminal during a `with` block.

    The block gets a function to call with the finished amount of work, at most `total`. No bar is shown in a pipe, with
    --json (`silent`) or with -q. `what` names the work in the bar.
    """
    # A bar would fill a file or a pipe with control characters.
    if silent or not sys.stderr.isatty() or logging.getLogger("rover_pin").level > logging.INFO:
        yield lambda done: None
        return
    from rich.progress import Progress

    columns = (plain_column("{task.description}"), *Progress.get_default_columns()[1:])
    with Progress(*columns, console=plain_console(stderr=True), transient=True) as bar:
        task = bar.add_task(printable(what), total=total)
        yield lambda done: bar.update(task, completed=done)
