"""Work on this machine's cores (joblib) or on a Dask cluster; what distributes it is theirs, not ours."""

import os
import socket
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rover_pin.base.errors import MissingExtraError, ParameterError, SimulationError
from rover_pin.base.jobs.safe_environment import safe_path
from rover_pin.base.jobs.workers import working_for

CONNECT_SECONDS = 5
"""How long a scheduler may take to be reached."""
START_SECONDS = 30
"""How long it may then take to answer, and its first worker to be there: a busy machine starts one in 10 s."""
AT_ONCE = 8
"""Short jobs that a process is handed at a time, at most."""
Workers = Any
"""How many processes (int; -1 for one a core), or the client of a cluster (distributed.Client)."""


def refuse_both(workers: int | None, scheduler: str | None) -> None:
    """Refuse a number of processes beside a scheduler."""
    if workers is not None and scheduler is not None:
        raise ParameterError("workers and scheduler are both given: the scheduler's workers are its own; drop one.")


@contextmanager
def workers_of(count: int, scheduler: str | None) -> Iterator[Workers]:
    """Yield that many processes, or the cluster of the Dask scheduler at an address.

    Raises ParameterError, MissingExtraError: as of `client_of`.
    """
    if scheduler is None:
        yield count
    else:
        with client_of(scheduler) as client:
            yield client


def results(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: Workers, short: bool = False
) -> Iterator[Any]:
    """Yield `function(*job)` for each job, in order; one worker is this process itself.

    What a dead worker of a cluster was at is run again by another. Jobs that are `short` are handed to processes
    several at a time: what they share is sent once.

    Raises SimulationError: the scheduler went away, or a job cannot be run there.
    """
    if workers == 1:
        return (function(*job) for job in jobs)
    if not isinstance(workers, int):
        return _on_cluster(function, jobs, workers)
    from joblib import effective_n_jobs

    at_once = handed_at_once(len(jobs), effective_n_jobs(workers)) if short else "auto"
    begun = on_processes(function, jobs, workers, return_as="generator", batch_size=at_once)
    next(begun)
    return begun


def on_processes(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: int, **options: Any
) -> Generator[Any, None, None]:
    """Yield None when the workers are at work, then `function(*job)` of each job; `options` are joblib's.

    A process has one thread and a share of the machine's memory, and takes no code from the working directory.

    Raises SimulationError: a process died, or needs more memory than its share.
    """
    from joblib import Parallel, delayed, effective_n_jobs, parallel_config
    from joblib.externals.loky.process_executor import BrokenProcessPool

    count = min(effective_n_jobs(workers), max(len(jobs), effective_n_jobs(-1)))  # more would have nothing to do
    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=count, **options)
    try:
        with safe_path():
            results = parallel(delayed(working_for)(os.getpid(), count, function, *job) for job in jobs)
            yield None
            yield from results
    except BrokenProcessPool as error:
        raise SimulationError("A worker process died (killed, out of memory, or a crash in native code).") from error
    except MemoryError as error:
        raise SimulationError(
            f"A job needs more memory than the share of one of {count} processes: take fewer workers."
        ) from error


def handed_at_once(jobs: int, workers: int) -> int:
    """Return how many short jobs a process is handed at a time: all have two turns at least, so none idles for long."""
    return min(max(jobs // (2 * workers), 1), AT_ONCE)


def _on_cluster(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], client: Any) -> Iterator[Any]:
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    address = client.scheduler.address
    for future in [client.submit(function, *job, pure=False) for job in jobs]:
        try:
            yield future.result()
        except KilledWorker as error:
            raise SimulationError(f"A job killed every worker of the cluster at {address} that took it.") from error
        except (FutureCancelledError, OSError) as error:
            raise SimulationError(f"The Dask scheduler at {address} went away.") from error
        except ImportError as error:
            raise SimulationError(
                f"The cluster at {address} cannot run this ({error}): install the same packages there as here."
            ) from error


@contextmanager
def client_of(address: str) -> Iterator[Any]:
    """Yield the client of the Dask scheduler at an address, with a worker at least.

    Raises MissingExtraError: dask is not installed.
    Raises ParameterError: no scheduler answers there, or it has no workers.
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError as error:
        raise MissingExtraError(
            "Work on a cluster needs Dask: run `pip install 'rover-pin[cluster]'` here and on the workers."
        ) from error
    try:
        # Asked before Dask starts its threads, which a busy machine may do too late for Dask.
        socket.create_connection(get_address_host_port(address, strict=True), CONNECT_SECONDS).close()
        client = Client(address, timeout=START_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ParameterError(
            f"No Dask scheduler answers at '{address}': start one with `dask scheduler` "
            "and give the address that it prints, such as tcp://127.0.0.1:8786."
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=START_SECONDS)
        except OSError as error:
            raise ParameterError(
                f"The Dask scheduler at '{address}' has no workers: start some with `dask worker {address}`."
            ) from error
        yield client
