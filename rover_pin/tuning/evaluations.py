"""Evaluations on all cores, remembered: what is finished is in a file and is not run again."""

import hashlib
import inspect
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rover_pin.base.code_digest import key_of_code
from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import content
from rover_pin.base.jobs.cluster import Workers, results

FILE = "evaluations.jsonl"
Progress = Callable[[str, int, int], None]
"""Called with the stage's name, how many of its evaluations are done, and how many there are."""


class Evaluations:
    """Runs `function(*arguments) -> list of float`; a result is in the file before it is used.

    Parameters
    ----------
    folder : Path, optional
        Where the file lies; without one nothing is remembered.
    workers : int or client, optional
        Processes, or a cluster (`cluster.workers_of`); by default one process a core. One is this process itself.

    Raises
    ------
    DataError
        The folder cannot be used.
    """

    def __init__(self, folder: Path | None, workers: Workers | None, progress: Progress | None):
        self.file = None if folder is None else folder / FILE
        self.workers, self.progress = workers or -1, progress
        self.known = {} if self.file is None else _read(self.file)
        self.fresh = 0

    def run(
        self, stage: str, function: Callable[..., list[float]], jobs: Sequence[tuple[Any, ...]]
    ) -> list[list[float]]:
        """Return the results of all jobs, in order."""
        keys = [key_of(function, job) for job in jobs]
        new = {key: job for key, job in zip(keys, jobs, strict=True) if key not in self.known}
        done = len(jobs) - len(new)
        for key, result in zip(new, self._compute_jobs(function, list(new.values())), strict=True):
            self._remember(key, result)
            done += 1
            if self.progress:
                self.progress(stage, done, len(jobs))
        return [self.known[key] for key in keys]

    def resume_hint(self) -> str:
        """Return what is kept and how to go on with it."""
        if self.file is None or not self.known:
            return "nothing is kept"
        return f"{len(self.known)} evaluations are kept in {self.file}: tune again into the same folder to go on"

    def _compute_jobs(self, function: Callable[..., list[float]], jobs: list[tuple[Any, ...]]) -> Any:
        return results(function, jobs, self.workers) if jobs else []

    def _remember(self, key: str, result: list[float]) -> None:
        self.known[key] = result
        self.fresh += 1
        if self.file is not None:
            with self.file.open("ab") as file:
                # One write: a killed process leaves whole lines and at most one torn one, which is not read.
                file.write(json.dumps([key, result]).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())


def key_of(function: Callable[..., Any], job: tuple[Any, ...]) -> str:
    """Return what names an evaluation: this code and the function's own file, and every argument to its last digit."""
    file = inspect.getsourcefile(function)
    code = key_of_code([Path(file)] if file else [])
    return hashlib.sha1(repr((code, function.__qualname__, job)).encode()).hexdigest()


def _read(file: Path) -> dict[str, list[float]]:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        raw = content(file) if file.exists() else b""
        complete = raw[: raw.rfind(b"\n") + 1]
        if len(complete) < len(raw):
            part = file.with_name(f".{file.name}.part")
            part.write_bytes(complete)
            part.replace(file)
        return dict(json.loads(line) for line in complete.splitlines())
    except OSError as error:
        raise DataError(f"{file}: evaluations cannot be kept there: {error.strerror}; name another folder.") from error
    except (ValueError, TypeError) as error:
        raise DataError(f"{file}: the file is damaged ({error}); remove it and tune again.") from error
