"""Run evaluations on all cores and keep their results in a file, so that a stopped tuning can be continued."""

import hashlib
import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rover_pin.base.code_digest import key_of_code
from rover_pin.base.errors import DataError
from rover_pin.base.files.journal import Journal
from rover_pin.base.jobs.cluster import Workers, results

FILE = "evaluations.jsonl"
"""Name of the file with the results, one line for each evaluation."""
Progress = Callable[[str, int, int], None]
"""A function that reports progress. It is called with the name of a stage of the tuning, the number of evaluations of
this stage that are finished, and their total."""


class Evaluations:
    """A runner of evaluations. An evaluation is a call `function(*arguments)` that returns a list of floats.

    The calls run in parallel. Each result is written to a file before it is used. When an equal evaluation is requested
    again, also by a later process, its result is read from the file.

    Parameters
    ----------
    folder : Path, optional
        Folder of the file; without a folder, the results are kept in memory only.
    workers : int or client, optional
        Number of processes, or a cluster (`cluster.workers_of`); by default one process per core. With one process, the
        calls run in the present process.
    progress : callable, optional
        Called after each evaluation, see `Progress`.

    Raises
    ------
    DataError
        The folder cannot be used, or the file in it is damaged.

    Examples
    --------
    >>> from rover_pin.tuning.drives import CONSTANT_DUTY, Control, full_score
    >>> from rover_pin.tuning.study import DriveCase, SlipLaw
    >>> job = DriveCase("flat", "flat", (("duration", 2.0),)), Control.of(CONSTANT_DUTY, SlipLaw())
    >>> len(Evaluations(None, 1, None).run("score", full_score, [job])[0])
    6
    """

    def __init__(self, folder: Path | None, workers: Workers | None, progress: Progress | None):
        self.file = None if folder is None else folder / FILE
        self.workers, self.progress = workers or -1, progress
        self.known = {} if self.file is None else _read(self.file)
        self.fresh = 0
        "number of evaluations that were computed and not read from the file"

    def run(
        self, stage: str, function: Callable[..., list[float]], jobs: Sequence[tuple[Any, ...]]
    ) -> list[list[float]]:
        """Return the results of `function(*job)` for all jobs, in their order. Only jobs without a kept result are
        computed.

        `stage` is the name of the stage of the tuning, for the report of progress.
        """
        # Equal jobs have one key, so that each is computed once.
        keys = [key_of(function, job) for job in jobs]
        new = {key: job for key, job in zip(keys, jobs, strict=True) if key not in self.known}
        done = len(jobs) - len(new)
        computed = results(function, list(new.values()), self.workers) if new else []
        # `computed` yields one result after another, so that a run that is stopped keeps the results up to then.
        for key, result in zip(new, computed, strict=True):
            self.known[key] = result
            self.fresh += 1
            if self.file is not None:
                Journal(self.file).append([key, result])
            done += 1
            if self.progress:
                self.progress(stage, done, len(jobs))
        return [self.known[key] for key in keys]

    def resume_hint(self) -> str:
        """Return a sentence for a user who has stopped the tuning: the number of stored evaluations, and how to
        continue.
        """
        if self.file is None or not self.known:
            return "No evaluation is kept."
        return f"{len(self.known)} evaluations are kept in {self.file}. To continue, tune again with the same folder."


def key_of(function: Callable[..., Any], job: tuple[Any, ...]) -> str:
    """Return the key of the stored result of an evaluation.

    The key is a digest of the package's code, of the file that defines the function, and of all arguments. After the
    code or an argument has changed, the kept result is therefore not used again.
    """
    file = inspect.getsourcefile(function)
    code = key_of_code([Path(file)] if file else [])
    return hashlib.sha1(repr((code, function.__qualname__, job)).encode()).hexdigest()


def _read(file: Path) -> dict[str, list[float]]:
    """Return the kept results of evaluations from a file, by their keys. A partial last line, which a killed process
    may have left, is removed.

    Raises DataError: the file cannot be used or is damaged.
    """
    journal = Journal(file)
    # A killed process may have left a partial line, which is removed before new results are appended.
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        journal.repair()
        return dict(journal.entries())
    except OSError as error:
        raise DataError(
            f"{file}: the results of the drives cannot be kept in this file: {error.strerror}. Give another folder."
        ) from error
    except (ValueError, TypeError) as error:
        raise DataError(
            f"{file}: the file with the results of the drives is damaged ({error}). Remove the file and tune again."
        ) from error
