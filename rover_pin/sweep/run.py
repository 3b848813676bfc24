"""A batch study, run: its unfinished cases on cores or on a cluster, their rows into a folder."""

import hashlib
import logging
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rover_pin.base.console import plain_column, plain_console
from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.files.bounded import content
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.jobs.cluster import refuse_both
from rover_pin.base.jobs.time_left import SECONDS_BETWEEN_LINES
from rover_pin.base.jobs.workers import ending_workers
from rover_pin.sweep.axis import LogRange, Values
from rover_pin.sweep.case import CaseFunction, Row, check_names, drive_case, run_case
from rover_pin.sweep.spread import on_cluster, on_cores
from rover_pin.sweep.store import CSV, RESULTS, Store
from rover_pin.sweep.study import Case, Study

Advance = Callable[[bool], None]
"""To be called after each case with whether it failed."""
LOG = logging.getLogger("rover_pin")


@contextmanager
def progress(name: str, total: int, done: int) -> Iterator[Advance]:
    """Show on stderr how many of `total` cases are finished, `done` of them before."""
    display = _silent if LOG.level > logging.INFO else _bar if sys.stderr.isatty() else _lines
    with display(name, total, done) as advance:
        yield advance


@contextmanager
def _silent(name: str, total: int, done: int) -> Iterator[Advance]:
    yield lambda has_failed: None


@contextmanager
def _bar(name: str, total: int, done: int) -> Iterator[Advance]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    counts = (MofNCompleteColumn(), plain_column("{task.fields[failures]} failed"))
    columns = (plain_column("{task.description}"), BarColumn(), *counts, TimeRemainingColumn(), plain_column("left"))
    failed = 0
    with Progress(*columns, console=plain_console(stderr=True)) as bar:
        task = bar.add_task(name, total=total, completed=done, failures=0)

        def advance(has_failed: bool) -> None:
            nonlocal failed
            failed += has_failed
            bar.update(task, advance=1, failures=failed)

        yield advance


@contextmanager
def _lines(name: str, total: int, done: int) -> Iterator[Advance]:
    start = last = time.monotonic()
    finished = failed = 0

    def say() -> None:
        seconds = (time.monotonic() - start) / max(finished, 1) * (total - done - finished)
        remaining = f", about {seconds:.0f} s left" if finished and finished + done < total else ""
        print(f"{name}: {done + finished} of {total} cases, {failed} failed{remaining}", file=sys.stderr, flush=True)

    def advance(has_failed: bool) -> None:
        nonlocal finished, failed, last
        finished += 1
        failed += has_failed
        if time.monotonic() - last > SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            say()

    say()
    yield advance
    say()


PICTURE = "summary.png"


@dataclass(frozen=True)
class Results:
    """What came of a sweep: a pandas DataFrame as of `collect`, and the folder where it lies."""

    name: str
    table: Any
    folder: Path
    taken_over: int = 0
    "cases that an earlier run had finished there"

    def summary(self) -> dict[str, Any]:
        """Return how many cases there are, how many failed and most often why, and the files."""
        errors = self.table["error"].dropna()
        reasons = {str(reason): int(count) for reason, count in errors.value_counts().head(3).items()}
        files = [str(self.folder / name) for name in (RESULTS, CSV, PICTURE) if (self.folder / name).is_file()]
        counts = {"cases": len(self.table), "taken_over": self.taken_over, "failed": len(errors)}
        return {"study": self.name, **counts, "reasons": reasons, "files": files}


def sweep(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    case_function: CaseFunction = drive_case,
    picture: bool = True,
) -> Results:
    """Run the study's cases and return their results; what is finished is in `folder` and is not run again.

    Parameters
    ----------
    study : Study
        From `read_study` or made in Python.
    folder : path, optional
        Where `results.parquet`, `results.csv` and `summary.png` go; by default `out/<name of the study>`.
    workers : int, optional
        Processes on this machine; by default one a core.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers then do the work. Start them with `--nthreads 1`.
    case_function : callable, optional
        `(study, case) -> outcomes` to run instead of the scenario; it takes chance from `case.seed` only.
    picture : bool
        Whether to draw `summary.png`.

    Returns
    -------
    Results
        Whose `table` has one row a case, equal for any number of workers; a failed case has its reason in `error`.

    Raises
    ------
    ParameterError
        A scenario or parameter that does not exist, both `workers` and `scheduler` given, a scheduler that does not
        answer, or a function that cannot be sent to workers.
    DataError
        The folder holds another study, another process is at work there, or its disk is full.
    MissingExtraError
        `scheduler` given and Dask not installed, or a worker lacks what a drive needs.
    SimulationError
        The workers or the scheduler died; finished cases are kept.
    """
    refuse_both(workers, scheduler)
    place = Path(folder or Path("out") / study.name)
    with alone_in(place), ending_workers():
        store = Store(place, fingerprint(study, case_function))
        before = store.keys()
        pending = [case for case in study.cases() if case.key not in before]
        if pending and case_function is drive_case:
            check_names(study, pending)
        try:
            _run_cases(store, pending, partial(run_case, study, case_function), workers, scheduler)
            results = Results(study.name, store.finish(), store.folder, len(before))
            if picture:
                _draw(study, results)
        except OSError as error:
            raise DataError(
                f"{place}: the results cannot be written ({error.strerror or error}). What is finished is kept there: "
                "make room, and run the same sweep again to go on."
            ) from error
        return results


def _draw(study: Study, results: Results) -> None:
    """Draw the summary, unless every case failed."""
    from rover_pin.plot.sheet import save
    from rover_pin.plot.study import study_figure

    if results.table["error"].isna().any():
        logarithmic = [name for name, axis in study.parameters.items() if isinstance(axis, LogRange)]
        figure = study_figure(study.name, results.table, _units(study), logarithmic)
        save(figure, results.folder / PICTURE)


def _units(study: Study) -> dict[str, str]:
    """Return the parameters with their units, as far as the scenario knows them."""
    from rover_pin.scenarios.scenario import settings_of

    try:
        first = next(iter(study.cases())).values
        units = {setting.name: setting.unit for setting in settings_of(study.scenario, **{**study.settings, **first})}
    except RoverPinError:  # a function of the user's own drives something else
        units = {}
    return {name: units.get(name, "") for name in study.parameters}


def _run_cases(
    store: Store, pending: Sequence[Case], work: Callable[[Case], Row], workers: int | None, scheduler: str | None
) -> None:
    """Run the cases that are left; stopped, say what is kept and where."""
    if not pending:
        return
    rows = on_cores(work, pending, workers) if scheduler is None else on_cluster(work, pending, scheduler)
    done = len(store.keys())
    total = done + len(pending)
    try:
        with closing(rows), progress(str(store.study["name"]), total, done) as advance:
            for row in rows:
                store.append(row)
                done += 1
                advance(row["error"] is not None)
    except (KeyboardInterrupt, SystemExit) as stop:
        stop.add_note(f"{done} of {total} cases are kept in {store.folder}: run the same sweep again to go on")
        raise


def fingerprint(study: Study, case_function: CaseFunction) -> dict[str, Any]:
    """Return what must be the same for results to belong together."""
    module, name = (getattr(case_function, part, "?") for part in ("__module__", "__qualname__"))
    files = _files(study)
    description = {"rover_pin": _version(), "case_function": f"{module}.{name}", **study.describe()}
    return {**description, "files": files} if files else description


def _files(study: Study) -> dict[str, str]:
    """Return a digest of each file that the study names, as a model or a ground: once changed, it is another study."""
    lists = [axis.values for axis in study.parameters.values() if isinstance(axis, Values)]
    words = {word for values in (study.settings.values(), *lists) for word in values if isinstance(word, str)}
    return {word: hashlib.sha256(content(word)).hexdigest()[:16] for word in sorted(words) if is_file(Path(word))}


def _version() -> str:
    try:
        return version("rover-pin")
    except PackageNotFoundError:
        return "not installed"
