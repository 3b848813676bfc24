"""Run a batch study: unfinished cases run on all cores or on a cluster, and their rows are saved in a folder."""

import hashlib
import logging
import sys
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rover_pin.base.console import plain_column, plain_console, warn
from rover_pin.base.encode import printable
from rover_pin.base.errors import DataError, ParameterError, RoverPinError, SimulationError
from rover_pin.base.files.bounded import content
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.jobs.cluster import client_of, on_processes, refuse_both
from rover_pin.base.jobs.time_left import SECONDS_BETWEEN_LINES
from rover_pin.base.jobs.workers import ending_workers
from rover_pin.sweep.case import CaseFunction, Row, check_names, drive_case, failed_row, run_case
from rover_pin.sweep.plan import LogRange, Values
from rover_pin.sweep.store import CSV, RESULTS, Store
from rover_pin.sweep.study import Case, Study

PICTURE = "summary.png"
"""Name of the file with the picture of the results."""
RETRY_SECONDS = 60
"""Longest time [s] to wait for a case that Dask runs a second time because its worker was lost. After this time the
scheduler counts as lost, and the sweep ends. A single drive usually takes less than a minute."""
KEPT = "The finished cases are kept: run the same sweep again to continue"
"""Sentence at the end of errors that stop a sweep."""


@dataclass(frozen=True)
class Results:
    """Results of a sweep: the table as a pandas DataFrame with the columns of `collect`, and the folder with the
    files.
    """

    name: str
    table: Any
    folder: Path
    taken_over: int = 0
    "number of cases that an earlier run had already finished in this folder"

    def summary(self) -> dict[str, Any]:
        """Return an overview of the results: the number of cases and of failed cases, the three most frequent errors,
        and the paths of the files.
        """
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
    """Run all cases of a study and return their results.

    Each finished case is saved in `folder` at once. If the sweep is stopped, call it again with this study and folder:
    only the unfinished cases run, and the final files equal the files of an uninterrupted sweep to the byte.

    Parameters
    ----------
    study : Study
        From `read_study`, or made in Python.
    folder : path, optional
        Folder for `results.parquet`, `results.csv` and `summary.png`; by default `out/<name of the study>`.
    workers : int, optional
        Number of processes on this machine; by default one per core.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run the cases instead. Start the workers with `--nthreads 1`.
    case_function : callable, optional
        `(study, case) -> outcomes`, run instead of the scenario. It must draw random numbers from `case.seed` only.
    picture : bool
        Whether to draw `summary.png`.

    Returns
    -------
    Results
        Its `table` has one row per case and is equal for any number of workers. A failed case has its reason in the
        column `error`.

    Raises
    ------
    ParameterError
        If a scenario or parameter does not exist, if both `workers` and `scheduler` are given, if the scheduler does
        not answer, or if the case function cannot be sent to worker processes.
    DataError
        If the folder holds another study, if another process writes to it, or if the disk is full.
    MissingExtraError
        If `scheduler` is given and Dask is not installed, or if a worker lacks a package that a drive needs.
    SimulationError
        If the workers or the scheduler died. Finished cases are kept.

    Examples
    --------
    >>> from rover_pin.sweep import Grid, LogRange, Study, sweep
    >>> study = Study("shear", "flat", {"soil.k": LogRange(1e-3, 1e-1)}, Grid(points=3), duration=5.0)
    >>> table = sweep(study, "out/shear").table  # doctest: +SKIP
    """
    refuse_both(workers, scheduler)
    place = Path(folder or Path("out") / study.name)
    with alone_in(place), ending_workers():
        # Finished cases of an earlier run are skipped, if the description of the study is unchanged.
        store = Store(place, fingerprint(study, case_function))
        before = store.keys()
        pending = [case for case in study.cases() if case.key not in before]
        # An unknown name would fail in every case, so it is reported before the first.
        if pending and case_function is drive_case:
            check_names(study, pending)
        work = partial(run_case, study, case_function)
        try:
            if pending:
                rows = on_cores(work, pending, workers) if scheduler is None else on_cluster(work, pending, scheduler)
                _save_rows(store, rows, len(before), len(before) + len(pending))
            results = Results(study.name, store.finish(), store.folder, len(before))
            # The picture shows the outcomes against the parameters. If every case failed, there is no outcome to draw.
            if picture and results.table["error"].isna().any():
                from rover_pin.plot.sheet import save
                from rover_pin.plot.study import study_figure
                from rover_pin.scenarios.scenario import settings_of

                # The scenario knows the units of its settings. With a case function of the user there may be no such
                # scenario.
                try:
                    first = next(iter(study.cases())).values
                    known = settings_of(study.scenario, **{**study.settings, **first})
                    units = {setting.name: setting.unit for setting in known}
                except RoverPinError:
                    units = {}
                # Parameters on a logarithmic scale get a logarithmic axis.
                logarithmic = [name for name, axis in study.parameters.items() if isinstance(axis, LogRange)]
                labels = {name: units.get(name, "") for name in study.parameters}
                save(study_figure(study.name, results.table, labels, logarithmic), results.folder / PICTURE)
        except OSError as error:
            raise DataError(
                f"{place}: the results cannot be written ({error.strerror or error}). {KEPT}, "
                "after making room on the disk."
            ) from error
        return results


def _save_rows(store: Store, rows: Generator[Row, None, None], done: int, total: int) -> None:
    """Save the row of each case as soon as the case is finished, and show the progress.

    `total` is the number of all cases, and `done` is the number of cases that an earlier run has finished.
    """
    # A row is on the disk before the loop waits for the next row, so that a stop loses no finished case.
    try:
        with closing(rows), progress(str(store.study["name"]), total, done) as advance:
            for row in rows:
                store.append(row)
                done += 1
                advance(row["error"] is not None)
    except (KeyboardInterrupt, SystemExit) as stop:
        stop.add_note(f"{done} of {total} cases are kept in {store.folder}: run the same sweep again to continue")
        raise


def fingerprint(study: Study, case_function: CaseFunction) -> dict[str, Any]:
    """Return a description of everything on which the results of a sweep depend.

    A results folder stores this description. A sweep may continue with the results in a folder only if the descriptions
    are equal. The description contains the version of the package, the name of the case function, the study, and a
    digest of each file that the study names (a model or a terrain).
    """
    try:
        # Another version of the package may give other results, so the version is part of the description.
        package = version("rover-pin")
    except PackageNotFoundError:
        package = "not installed"
    module, name = (getattr(case_function, part, "?") for part in ("__module__", "__qualname__"))
    description = {"rover_pin": package, "case_function": f"{module}.{name}", **study.describe()}
    # A file that the study names can change while its name stays, so the digest of its content is part of the
    # description.
    lists = [axis.values for axis in study.parameters.values() if isinstance(axis, Values)]
    words = {word for values in (study.settings.values(), *lists) for word in values if isinstance(word, str)}
    files = {word: hashlib.sha256(content(word)).hexdigest()[:16] for word in sorted(words) if is_file(Path(word))}
    return {**description, "files": files} if files else description


def on_cores(work: Callable[[Case], Row], cases: Sequence[Case], workers: int | None) -> Generator[Row, None, None]:
    """Run the cases in `workers` processes (by default one for each core), and yield the row of each case at the end of
    the case.

    `work` is the function that takes a case and returns its row. With one worker the cases run in this process, where a
    debugger can follow them.

    Raises ParameterError if `workers` is not a whole number of at least 1, or if `work` cannot be sent to a process.
    Raises SimulationError if a worker process died.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise ParameterError(
            f"workers = {workers!r} is not allowed: give a whole number of at least 1, or leave workers "
            "out to use all cores."
        )
    # With one worker, the cases run in this process, so that an error shows its place in the code.
    if workers == 1:
        yield from map(work, cases)
        return
    _check_sendable(work)
    jobs = [(case,) for case in cases]
    rows = on_processes(work, jobs, -1 if workers is None else workers, return_as="generator_unordered")
    # The first item is None and shows that the processes have started.
    next(rows)
    try:
        for row in rows:  # noqa: UP028  `yield from` would close the generator before the handler below does
            yield row
    except GeneratorExit:
        with warnings.catch_warnings(action="ignore"):  # joblib warns of tasks whose results nobody collects
            rows.close()
        raise
    except SimulationError as error:
        raise SimulationError(
            f"{str(error).rstrip('.')}. {KEPT}, or set workers=1 to see at which case it fails."
        ) from error


def on_cluster(work: Callable[[Case], Row], cases: Sequence[Case], address: str) -> Generator[Row, None, None]:
    """Run the cases on the Dask cluster at `address`, and yield the row of each case at the end of the case.

    If a case kills its workers, its row states this error, and the other cases continue.

    Raises ParameterError if the scheduler does not answer, or if `work` cannot be sent to it.
    Raises SimulationError if the scheduler is lost, or if the workers cannot run the cases.
    """
    with client_of(address) as client:
        _check_sendable(work)
        from distributed import KilledWorker, as_completed

        # With pure=False, Dask runs each case anew instead of returning a result that it holds from an earlier sweep.
        case_of = dict(zip(client.map(work, cases, pure=False), cases, strict=True))
        for future, result in as_completed(list(case_of), loop=client.loop, with_results=True, raise_errors=False):
            case = case_of.pop(future)
            # The case was lost together with its worker. Dask runs it again on another worker, so wait for it.
            if future.status in ("pending", "lost"):
                with suppress(Exception):
                    result = future.result(timeout=RETRY_SECONDS)
            if future.status == "finished":
                yield result
            elif future.status != "error":
                raise SimulationError(f"The Dask scheduler at {address} is no longer reachable. {KEPT}.")
            elif isinstance(future.exception(), KilledWorker):
                yield failed_row(case, future.exception())
            else:
                # `run_case` turns errors of a case into rows, so this error concerns the worker's installation.
                cause = future.exception()
                while cause.__cause__ is not None:
                    cause = cause.__cause__
                raise SimulationError(
                    f"The cluster at {address} cannot run the cases ({' '.join(str(cause).split())}): "
                    f"install the same packages there as here. {KEPT}."
                )


def _check_sendable(work: Callable[[Case], Row]) -> None:
    """Check that a case function can be pickled, because only then it can be sent to another process.

    Raises ParameterError: the case function cannot be pickled.
    """
    from joblib.externals.loky.backend.reduction import dumps

    try:
        # The function is pickled once here, so that the error names the cause before processes start.
        dumps(work)
    except Exception as error:
        raise ParameterError(
            f"The case function cannot be sent to worker processes ({error}). Let it refer only to plain data, and "
            "open files, locks and the like inside the function, or set workers=1."
        ) from error


Advance = Callable[[bool], None]
"""Type of a function that is called after each case to show the progress; its argument states whether the case
failed."""
LOG = logging.getLogger("rover_pin")
"""The log of the package. Its level decides whether progress is shown."""


@contextmanager
def progress(name: str, total: int, done: int) -> Iterator[Advance]:
    """Show on stderr the number of finished cases out of `total`; `done` of them were finished before.

    A terminal gets a bar, a file gets a line from time to time, and with --quiet nothing is shown.
    """
    if LOG.level > logging.INFO:
        yield lambda has_failed: None
        return
    with (_bar if sys.stderr.isatty() else _lines)(name, total, done) as advance:
        yield advance


@contextmanager
def _bar(name: str, total: int, done: int) -> Iterator[Advance]:
    """Show a progress bar on the terminal. For the arguments, see `progress`."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    counts = (MofNCompleteColumn(), plain_column("{task.fields[failures]} failed"))
    columns = (plain_column("{task.description}"), BarColumn(), *counts, TimeRemainingColumn(), plain_column("left"))
    failed = 0
    with Progress(*columns, console=plain_console(stderr=True)) as bar:
        task = bar.add_task(printable(name), total=total, completed=done, failures=0)

        def advance(has_failed: bool) -> None:
            nonlocal failed
            failed += has_failed
            bar.update(task, advance=1, failures=failed)

        yield advance


@contextmanager
def _lines(name: str, total: int, done: int) -> Iterator[Advance]:
    """Print a line on stderr at the beginning, from time to time, and at the end. For the arguments, see `progress`."""
    start = last = time.monotonic()
    finished = failed = 0

    def print_line() -> None:
        # The remaining time follows from the mean time of the cases of this run only.
        seconds = (time.monotonic() - start) / max(finished, 1) * (total - done - finished)
        remaining = f", about {seconds:.0f} s left" if finished and finished + done < total else ""
        warn(f"{name}: {done + finished} of {total} cases, {failed} failed{remaining}")

    def advance(has_failed: bool) -> None:
        # Lines are printed only at intervals, because a file with one line for each case would be too long to read.
        nonlocal finished, failed, last
        finished += 1
        failed += has_failed
        if time.monotonic() - last > SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            print_line()

    print_line()
    yield advance
    print_line()
