"""A batch study, run: its unfinished cases on cores or on a cluster, their rows into a folder."""

from __future__ import annotations

from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rover_pin.errors import ParameterError
from rover_pin.sweep.case import CaseFunction, drive_case, run_case
from rover_pin.sweep.progress import progress
from rover_pin.sweep.spread import on_cluster, on_cores
from rover_pin.sweep.store import Store
from rover_pin.sweep.study import Study


def sweep(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    case_function: CaseFunction = drive_case,
) -> Any:
    """Run the study's cases and return their table; what is finished is in `folder` and is not run again.

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
    pandas.DataFrame
        One row a case, equal for any number of workers; a failed case has its reason in `error`.

    Raises
    ------
    ParameterError
        Both `workers` and `scheduler` given, or a scheduler that does not answer.
    DataError
        The folder holds another study.
    MissingExtraError
        `scheduler` given and Dask not installed.
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
        rows = on_cores(work, left, workers) if scheduler is None else on_cluster(work, left, scheduler)
        with progress(study.name, len(cases), len(cases) - len(left)) as advance:
            for row in rows:
                store.append(row)
                advance(row["error"] is not None)
    return store.finish()


def fingerprint(study: Study, case_function: CaseFunction) -> dict[str, Any]:
    """Return what must be the same for results to belong together."""
    module, name = (getattr(case_function, part, "?") for part in ("__module__", "__qualname__"))
    return {"rover_pin": _version(), "case_function": f"{module}.{name}", **study.describe()}


def _version() -> str:
    try:
        return version("rover-pin")
    except PackageNotFoundError:
        return "not installed"
