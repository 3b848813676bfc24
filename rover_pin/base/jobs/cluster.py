"""Running many jobs in parallel, on the cores of this machine (by joblib) or on a Dask cluster."""

import os
import socket
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rover_pin.base.errors import MissingExtraError, ParameterError, SimulationError
from rover_pin.base.extras import install_command
from rover_pin.base.jobs.safe_environment import safe_path
from rover_pin.base.jobs.workers import working_for

CONNECT_SECONDS = 5
"""Maximum time to connect to a Dask scheduler [s]. After this time, the scheduler counts as absent. A connection within
one network takes milliseconds, and a user with a wrong address should not wait long."""
START_SECONDS = 30
"""Maximum time to wait for the answer of a Dask scheduler, and then for its first worker [s]. After this time, an error
is raised. A busy machine may need 10 s to start a worker."""
MAX_JOBS_AT_ONCE = 8
"""Maximum number of short jobs that are sent to a process together. More jobs would leave the other processes idle
while the last processes still work."""
Workers = Any
"""Type of the workers that run jobs: a number of processes (int; -1 means one for each core), or a client of a Dask
cluster (distributed.Client)."""


def refuse_both(workers: int | None, scheduler: str | None) -> None:
    """Check that a user did not give both a number of processes and the address of a Dask scheduler.

    A scheduler has its own workers, so a number of processes would have no meaning.

    Raises ParameterError: both were given.
    """
    if workers is not None and scheduler is not None:
        raise ParameterError(
            "workers and scheduler are both given, but a scheduler has its own workers: give only one."
        )


@contextmanager
def workers_of(count: int, scheduler: str | None) -> Iterator[Workers]:
    """Yield the workers to pass to `results`: a number of processes, or the client of a Dask scheduler.

    `scheduler` is the address of the scheduler. If it is None, the workers are `count` processes of this machine.

    Raises MissingExtraError: a scheduler is given, but Dask is not installed.
    Raises ParameterError: no scheduler answers at the address, or the scheduler has no workers.
    """
    if scheduler is None:
        yield count
    else:
        with client_of(scheduler) as client:
            yield client


def results(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: Workers, short: bool = False
) -> Iterator[Any]:
    """Yield the result of `function(*job)` for each job, in the order of the jobs.

    With one worker, the jobs run in this process. If a worker of a cluster dies, another worker runs its job again. If
    `short` is True, several jobs are sent to a process together, so that objects that the jobs share are sent only
    once.

    Raises SimulationError: the connection to the scheduler is lost, or a job cannot be run there.
    """
    # One worker needs no other process, and errors then show the place in the code directly.
    if workers == 1:
        return (function(*job) for job in jobs)
    if not isinstance(workers, int):
        return _on_cluster(function, jobs, workers)
    from joblib import effective_n_jobs

    batch = batch_size(len(jobs), effective_n_jobs(workers)) if short else "auto"
    # The first value (None) is taken here, so that the processes start now and not when the first result is read.
    begun = on_processes(function, jobs, workers, return_as="generator", batch_size=batch)
    next(begun)
    return begun


def on_processes(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: int, **options: Any
) -> Generator[Any, None, None]:
    """Run jobs on worker processes of this machine. Yield None when the processes have started, then each job's result.

    The results, `function(*job)`, come in the order of the jobs, unless `options`, which are passed to
    `joblib.Parallel`, ask for another order. Each process has one thread and a limited part of the machine's memory,
    and imports no module from the working directory.

    Raises SimulationError: a process died, or needs more memory than its limit.
    """
    from joblib import Parallel, delayed, effective_n_jobs, parallel_config
    from joblib.externals.loky.process_executor import BrokenProcessPool

    # More processes than there are jobs, or than the machine has cores, would have nothing to do.
    count = min(effective_n_jobs(workers), max(len(jobs), effective_n_jobs(-1)))
    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=count, **options)
    try:
        # The processes are started inside this block, because a new process inherits the search path of the block.
        with safe_path():
            results = parallel(delayed(working_for)(os.getpid(), count, function, *job) for job in jobs)
            yield None
            yield from results
    except BrokenProcessPool as error:
        raise SimulationError(
            "A worker process died: it was killed, ran out of memory, or crashed in compiled code. Run again, with "
            "fewer workers if the machine lacked memory."
        ) from error
    except MemoryError as error:
        raise SimulationError(
            f"A job needs more memory than each of the {count} processes may use: run with fewer workers."
        ) from error


def batch_size(jobs: int, workers: int) -> int:
    """Return the number of short jobs that are sent to a worker process together, as one batch.

    There are at least two batches for each process, so that no process is idle for long while the last jobs finish.
    """
    return min(max(jobs // (2 * workers), 1), MAX_JOBS_AT_ONCE)


def _on_cluster(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], client: Any) -> Iterator[Any]:
    """Yield the result of `function(*job)` for each job, in the order of the jobs, computed by the workers of a Dask
    client.

    Raises SimulationError: the connection to the scheduler is lost, a job kills its workers, or a worker lacks a
    package.
    """
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    address = client.scheduler.address
    # All jobs are submitted at once. `pure=False`: without it, Dask would compute equal jobs only once.
    for future in [client.submit(function, *job, pure=False) for job in jobs]:
        try:
            yield future.result()
        except KilledWorker as error:
            raise SimulationError(
                f"A job killed every worker of the cluster at {address} that ran it; see the log of the workers."
            ) from error
        except (FutureCancelledError, OSError) as error:
            raise SimulationError(
                f"The connection to the Dask scheduler at {address} was lost: start the scheduler again, and then this "
                "run."
            ) from error
        except ImportError as error:
            raise SimulationError(
                f"The workers of the cluster at {address} lack a package ({error}): install the same packages there as "
                "on this machine."
            ) from error


@contextmanager
def client_of(address: str) -> Iterator[Any]:
    """Yield a client of the Dask scheduler at an address such as tcp://127.0.0.1:8786. The scheduler has at least one
    worker.

    Raises MissingExtraError: Dask is not installed.
    Raises ParameterError: no scheduler answers at the address, or the scheduler has no workers.
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError as error:
        raise MissingExtraError(
            f"Work on a cluster needs Dask. Run `{install_command('cluster')}` here and on the workers."
        ) from error
    try:
        # A plain connection first: on a busy machine, Dask's own threads may start too late for its time limit.
        socket.create_connection(get_address_host_port(address, strict=True), CONNECT_SECONDS).close()
        client = Client(address, timeout=START_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ParameterError(
            f"No Dask scheduler answers at '{address}': start one with `dask scheduler` "
            "and give the address that it prints, such as tcp://127.0.0.1:8786."
        ) from error
    # The client closes its connection at the end of the block, also after an error.
    with client:
        try:
            client.wait_for_workers(1, timeout=START_SECONDS)
        except OSError as error:
            raise ParameterError(
                f"The Dask scheduler at '{address}' has no workers: start some with `dask worker {address}`."
            ) from error
        yield client
