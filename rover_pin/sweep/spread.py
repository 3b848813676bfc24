"""Cases on all cores (joblib) or on a cluster (Dask); what distributes the work is theirs, not ours."""

import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress

from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.base.jobs.cluster import client_of, on_processes
from rover_pin.sweep.case import Row, failed_row
from rover_pin.sweep.study import Case

AGAIN_SECONDS = 60
"""How long a case may take that Dask runs again."""
KEPT = "the finished cases are kept: run the sweep again to go on"


def on_cores(work: Callable[[Case], Row], cases: Sequence[Case], workers: int | None) -> Generator[Row, None, None]:
    """Yield rows as they are finished; `workers` processes with one thread each (all cores by default).

    One worker is this process itself, which a debugger can follow.
    """
    count = _count(workers)
    if count == 1:
        yield from map(work, cases)
        return
    _check_sendable(work)
    begun = on_processes(work, [(case,) for case in cases], count, return_as="generator_unordered")
    next(begun)
    try:
        for row in begun:  # noqa: UP028  `yield from` would close it first
            yield row
    except GeneratorExit:
        with warnings.catch_warnings(action="ignore"):  # joblib's advice on tasks that nobody waits for
            begun.close()
        raise
    except SimulationError as error:
        raise SimulationError(f"{str(error).rstrip('.')}; {KEPT}, or take workers=1 to see at which case.") from error


def on_cluster(work: Callable[[Case], Row], cases: Sequence[Case], address: str) -> Generator[Row, None, None]:
    """Yield rows as the Dask cluster at `address` finishes them; a case that kills its workers is a row too."""
    with client_of(address) as client:
        _check_sendable(work)
        from distributed import KilledWorker, as_completed

        case_of = dict(zip(client.map(work, cases, pure=False), cases, strict=True))
        for future, result in as_completed(list(case_of), loop=client.loop, with_results=True, raise_errors=False):
            case = case_of.pop(future)
            if future.status in ("pending", "lost"):  # lost with its worker: Dask runs it again
                with suppress(Exception):
                    result = future.result(timeout=AGAIN_SECONDS)
            if future.status == "finished":
                yield result
            elif future.status != "error":
                raise SimulationError(f"The Dask scheduler at {address} went away; {KEPT}.")
            elif isinstance(future.exception(), KilledWorker):
                yield failed_row(case, future.exception())
            else:
                reason = " ".join(str(_root(future.exception())).split())
                raise SimulationError(
                    f"The cluster at {address} cannot run the cases ({reason}): install the same packages there as "
                    f"here; {KEPT}."
                )


def _root(error: BaseException) -> BaseException:
    return error if error.__cause__ is None else _root(error.__cause__)


def _check_sendable(work: Callable[[Case], Row]) -> None:
    from joblib.externals.loky.backend.reduction import dumps

    try:
        dumps(work)
    except Exception as error:
        raise ParameterError(
            f"The case's function cannot be sent to worker processes ({error}): let it hold only plain data and open "
            "files, locks and the like when it is called, or take workers=1."
        ) from error


def _count(workers: int | None) -> int:
    if workers is None:
        return -1
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ParameterError(f"workers = {workers!r} is not allowed: it is a whole number from 1 on, or none for all.")
    return workers
