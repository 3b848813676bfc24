"""A batch study, run: its unfinished cases on cores or on a cluster, their rows into a folder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rover_pin.errors import ParameterError
from rover_pin.sweep.case import CaseFunction, check_names, drive_case, run_case
from rover_pin.sweep.progress import progress
from rover_pin.sweep.spread import on_cluster, on_cores
from rover_pin.sweep.store import CSV, RESULTS, Store
from rover_pin.sweep.study import Study


@dataclass(frozen=True)
class Results:
    """What came of a sweep: a pandas DataFrame as of `collect`, and the folder where it lies."""

    name: str
    table: Any
    folder: Path

    def summary(self) -> dict[str, Any]:
        """Return how many cases there are, how many failed and most often why, and the files."""
        errors = self.table["error"].dropna()
        reasons = {str(reason): int(count) for reason, count in errors.value_counts().head(3).items()}
        files = [str(self.folder / name) for name in (RESULTS, CSV)]
        return {"study": self.name, "cases": len(self.table), "failed": len(errors), "reasons": reasons, "files": files}


def sweep(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    case_function: CaseFunction = drive_case,
) -> Results:
    """Run the study's cases and return their results; what is finished is in `folder` and is not run again.

    Parameters
    ----------
    study : Study
        From `read_study` or made in Python.
    folder : path, optional
        Where `results.parquet` and `results.csv` go; by default `out/<name of the study>`.
    workers : int, optional
        Processes on this machine; by default one a core.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers then do the work. Start them with `--nthreads 1`.
    case_function : callable, optional
        `(study, case) -> outcomes` to run instead of the scenario; it takes chance from `case.seed` only.

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
        The folder holds another study.
    MissingExtraError
        `scheduler` given and Dask not installed, or a worker lacks what a drive needs.
    SimulationError
        The workers or the scheduler died; finished cases are kept.
    """
    if workers is not None and scheduler is not None:
        raise ParameterError("workers and scheduler are both given: the scheduler's workers are its own; drop one.")
    store = Store(Path(folder or Path("out") / study.name), fingerprint(study, case_function))
    cases = study.cases()
    finished = store.keys()
    left = [case for case in cases if case.key not in finished]
    work = partial(run_case, study, case_function)
    if left:
        if case_function is drive_case:
            check_names(study, left)
        rows = on_cores(work, left, workers) if scheduler is None else on_cluster(work, left, scheduler)
        with progress(study.name, len(cases), len(cases) - len(left)) as advance:
            for row in rows:
                store.append(row)
                advance(row["error"] is not None)
    return Results(study.name, store.finish(), store.folder)


def fingerprint(study: Study, case_function: CaseFunction) -> dict[str, Any]:
    """Return what must be the same for results to belong together."""
    module, name = (getattr(case_function, part, "?") for part in ("__module__", "__qualname__"))
    return {"rover_pin": _version(), "case_function": f"{module}.{name}", **study.describe()}


def _version() -> str:
    try:
        return version("rover-pin")
    except PackageNotFoundError:
        return "not installed"
