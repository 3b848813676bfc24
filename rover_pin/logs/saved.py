"""A trace on disk: one Parquet file, or the folder of a drive log."""

from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from rover_pin.simulation.trace.files import read_run, write_parquet
from rover_pin.simulation.trace.trace import Trace


def save_trace(trace: Trace, path: str | Path) -> Path:
    """Write a `trace` to a Parquet file where `path` ends with `.parquet`, else to a folder as a drive log of one run.

    Numbers come back exactly. Every file is written whole or not at all; `drive.toml` comes last.

    Raises DataError: it cannot be written there, or an attribute is not a plain value.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        return write_parquet(path, trace)
    if path.suffix == ".csv":
        raise DataError(f"{path}: a trace is saved to a folder, which gets a CSV and its description, or to .parquet.")
    return write_drive_log(path, {"run": trace}, LogMetadata.of(trace, path.name))


def load_trace(path: str | Path) -> Trace:
    """Return the trace that `save_trace` wrote: a Parquet file, or the only run of a drive log's folder.

    Raises DataError: the file or folder is not that, or the log has several runs.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        return read_run(path)
    runs = read_drive_log(path).runs
    if len(runs) > 1:
        raise DataError(f"{path}: the drive log has {len(runs)} runs: read it with `read_drive_log`, and choose one.")
    return runs[0]
