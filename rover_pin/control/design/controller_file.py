"""A controller from a user's file: `controller(model)` there returns what is asked at every sample."""

from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.public import SHORT
from rover_pin.base.trust import Trust
from rover_pin.base.users_code import is_stop, mistake
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.model.effect_files import run_file
from rover_pin.simulation.model.model import Model

MAKER = "controller"
"""The function of the file: from a `Model` to a controller."""


class FileController:
    """The controller that a file makes for a model; an error in its code is one sentence with file and line."""

    def __init__(self, file: Path, inner: Controller):
        self.file, self.inner = file, inner

    def reset(self) -> None:
        """Begin a drive anew, if the controller knows how to."""
        if hasattr(self.inner, "reset"):
            self._call_controller(self.inner.reset)

    def __call__(self, reading: Reading) -> Command | Any:
        """Return what it commands."""
        return self._call_controller(self.inner, reading)

    def _call_controller(self, function: Any, *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except Exception as error:
            if is_stop(error):
                raise
            raise mistake(error, str(self.file.resolve())) from error


def controller_of_file(file: str | Path, model: Model, trust: Trust = Trust()) -> FileController:
    """Return the controller of a .py file for a model; `trust` must allow its code to run.

    Raises DataError: the file is missing, is not trusted, cannot be run, or has no function `controller` that returns
    one.
    """
    path = Path(file)
    if not is_file(path):
        raise DataError(f"control = {path}: there is no such file; give a .py file with a function `{MAKER}(model)`.")
    trust.refuse_code(path, f"control = {path}")
    made = getattr(run_file(path), MAKER, None)
    if not callable(made):
        raise DataError(f"{path}: there is no function `{MAKER}(model)`, which returns what is asked at every sample.")
    try:
        inner = made(model)
    except Exception as error:
        if is_stop(error):
            raise
        raise mistake(error, str(path.resolve())) from error
    if not callable(inner):
        raise DataError(
            f"{path}: `{MAKER}(model)` returns {SHORT.repr(inner)}; return a function of the `Reading` that returns a "
            "duty in [-1, 1], several, or a `Command`."
        )
    return FileController(path, inner)
