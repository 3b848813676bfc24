"""What the command line takes in and prints: assignments, priors, tables, JSON, progress."""

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

from rover_pin.base.console import plain_column, plain_console
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.results_folder import say_what_is_replaced
from rover_pin.base.jobs.workers import Terminated, ending_workers

if TYPE_CHECKING:
    from rover_pin.base.settings import Setting

log = logging.getLogger(__name__)


def priors(words: Iterable[str]) -> dict[str, Any]:
    """Return NAME=MEAN:SD words as priors by name."""
    from rover_pin.base.quantity import parse_quantity, quantities
    from rover_pin.contact import Soil, Wheel
    from rover_pin.estimation.parameter import Prior

    result, units = {}, {name: spec.unit for name, spec in (quantities(Soil) | quantities(Wheel)).items()}
    for word in words:
        name, _, value = word.partition("=")
        mean, sign, sd = value.partition(":")
        bare = [text.strip()[-1:] in tuple("0123456789.") for text in (mean, sd)]
        if not sign or bare[0] != bare[1]:
            raise ParameterError(f"--prior {word}: write it as NAME=MEAN:SD, as --prior n=1.1:0.1 or phi=30deg:2deg.")
        where = f"--prior {word}: {name}"
        result[name] = Prior(
            *(parse_quantity(text, units.get(name.rpartition(".")[2], ""), where) for text in (mean, sd))
        )
    return result


def drive_settings(
    control: str, gravity: str, soil: str, model: Path | None, add: list[str], set_: list[str]
) -> dict[str, Any]:
    """Return the settings of a scenario that options give, those that are given alone; `--set` comes last."""
    options = {"control": control, "gravity": gravity, "soil": soil, "model": model and str(model), "add": add}
    return {**{name: value for name, value in options.items() if value}, **assignments(set_)}


def stages(is_silent: bool) -> Callable[[str, int, int], None]:
    """Return what says how far each stage of long work is."""
    from rover_pin.base.jobs.time_left import TimeLeft

    begun: dict[str, TimeLeft] = {}

    def say(name: str, done: int, total: int) -> None:
        begun.setdefault(name, TimeLeft(name)).note_done(done, total)
        if done == total:
            del begun[name]
            if not is_silent:
                log.info("%s: %d done", name, total)

    return say


def assignments(words: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Return NAME=VALUE words of an option as a dict; numbers as numbers."""
    values: dict[str, Any] = {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign:
            raise ParameterError(f"{option} {word}: write it as NAME=VALUE, as --set soil.k=0.01.")
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = value
    return values


@contextmanager
def stoppable(out: Path | None = None, replaced: Sequence[str] = (), untouched: Sequence[str] = ()) -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end a command, its workers too, with one line that says what is kept.

    What of an earlier run it will replace in its folder `out` is said first.
    """
    say_what_is_replaced(out, replaced, untouched)
    try:
        with ending_workers():
            yield
    except (KeyboardInterrupt, Terminated) as stop:
        message = "; ".join(getattr(stop, "__notes__", ())) or "nothing is kept"
        print(f"rover-pin: stopped: {message}.", file=sys.stderr)
        raise typer.Exit(128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT)) from None


def report(result: Mapping[str, Any], as_json: bool) -> None:
    """Print a result as a short table, or as one JSON object."""
    if as_json:
        print(json_text(result))
        return
    lines = [(name.replace("_", " "), (format_result(value) or "none").split("\n")) for name, value in result.items()]
    width = max((len(name) for name, _ in lines), default=0)
    for name, (first, *more) in lines:  # never folded nor shortened: paths are to be copied
        print(f"{name:{width}}  {first}".rstrip())
        for line in more:
            print(f"{'':{width}}  {line}")


WIDEST = 28
"""Letters of a column; a longer cell pushes its row alone."""


def numbers_table(settings: Iterable[Setting]) -> None:
    """Print what can be set, a line each: default with unit, bounds or choices, source."""
    rows = [("name", "default", "allowed", "from")]
    rows += [
        (setting.name, format_value(setting.value, setting.unit), limits_of(setting), setting.source)
        for setting in settings
    ]
    widths = [min(max(len(row[i]) for row in rows), WIDEST) for i in range(3)]
    for row in rows:
        cells = (f"{cell:{width}}" for cell, width in zip(row, widths, strict=False))
        print("  ".join([*cells, row[3]]).rstrip())


def fact(name: str, value: Any) -> str:
    """Return a fact in words, its name's unit behind it: "mass: 5.8 kg" of mass_kg."""
    from rover_pin.base.units import UNITS

    words, _, unit = name.rpartition("_")
    has_unit = unit in UNITS and bool(words)
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
    """Return a value as the table has it: six digits and its unit, an angle in degrees too."""
    if value is None or value == ():
        return "none"
    if isinstance(value, tuple) and all(isinstance(number, (int, float)) for number in value):
        return f"{', '.join(f'{number:.6g}' for number in value)} {unit}".rstrip()
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    degrees = f" = {math.degrees(value):.4g} {unit.replace('rad', 'deg')}" if unit.startswith("rad") and value else ""
    return f"{value:.6g} {unit}".rstrip() + (degrees if "/s" not in unit else "")


def limits_of(setting: Setting) -> str:
    """Return the choices or bounds of a setting as the table has them; of a number without, that any is allowed."""
    if setting.choices:
        return ", ".join(setting.choices)
    low, high = (f"{bound:g}" if math.isfinite(bound) else "" for bound in (setting.low, setting.high))
    if low or high:
        return f"{low} .. {high}".strip()
    return "any" if isinstance(setting.value, float) else "-"


def json_text(result: Mapping[str, Any]) -> str:
    """Return a result as strict JSON: a number that is not finite becomes null."""
    import json

    def strict(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {str(name): strict(entry) for name, entry in value.items()}
        if isinstance(value, (list, tuple)):
            return [strict(entry) for entry in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(strict(result), default=str, allow_nan=False)


def format_result(value: Any) -> str:
    """Return a value as the table shows it."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {format_result(entry)}" for name, entry in value.items())
    if isinstance(value, (list, tuple)):
        return "\n".join(format_result(entry) for entry in value)
    return str(value)


@contextmanager
def progress(what: str, total: float, silent: bool) -> Iterator[Callable[[float], None]]:
    """Show a progress bar over simulated seconds on a terminal; nothing where it would clutter."""
    if silent or not sys.stderr.isatty() or logging.getLogger("rover_pin").level > logging.INFO:
        yield lambda done: None
        return
    from rich.progress import Progress

    columns = (plain_column("{task.description}"), *Progress.get_default_columns()[1:])
    with Progress(*columns, console=plain_console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)
