"""Load a controller from a user's Python file, which has a function `controller(model)` that returns the controller."""

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
"""Name of the function in a user's file that takes a `Model` and returns the controller for this model."""


class FileController:
    """A controller from a user's file. If the user's code raises an error, the error is reported with its file and
    line.

    `file` is the path of the file, and `inner` is the controller that the file's function returned.
    """

    def __init__(self, file: Path, inner: Controller):
        self.file, self.inner = file, inner

    def reset(self) -> None:
        """Call the `reset` method of the user's controller, if there is such a method, at the start of a drive."""
        if hasattr(self.inner, "reset"):
            self._call_controller(self.inner.reset)

    def __call__(self, reading: Reading) -> Command | Any:
        """Return the command of the user's controller for a reading of the sensors."""
        return self._call_controller(self.inner, reading)

    def _call_controller(self, function: Any, *arguments: Any) -> Any:
        """Call a function of the user's controller. If the function raises an error, raise an error that names the file
        and the line.
        """
        try:
            return function(*arguments)
        except BaseException as error:  # a controller may also raise GeneratorExit or SystemExit
            if is_stop(error):
                raise
            raise mistake(error, str(self.file.resolve())) from error


def controller_of_file(file: str | Path, model: Model, trust: Trust = Trust()) -> FileController:
    """Return the controller that a user's .py file makes for a model, by calling the function `controller(model)` in
    the file.

    The file is executed, so that `trust` must allow its code to run.

    Raises DataError: the file is missing, is not allowed to run or raises an error, it has no function `controller`, or
    this function does not return a controller.
    """
    path = Path(file)
    if not is_file(path):
        raise DataError(
            f"control = {path}: this file does not exist. Give a .py file with a function `{MAKER}(model)`."
        )
    # The user must have consented before the first line of the file runs.
    trust.refuse_code(path, f"control = {path}")
    # The file is executed here; an error in it is reported with its line by `run_file`.
    made = getattr(run_file(path), MAKER, None)
    if not callable(made):
        raise DataError(
            f"{path} has no function `{MAKER}(model)`. Define this function; it returns the controller for a model."
        )
    # The user's function runs outside of `run_file`, so its errors are reported here.
    try:
        inner = made(model)
    except BaseException as error:
        if is_stop(error):
            raise
        raise mistake(error, str(path.resolve())) from error
    if not callable(inner):
        raise DataError(
            f"{path}: `{MAKER}(model)` returns {SHORT.repr(inner)}, which is no controller. Return a function that "
            "takes a `Reading` and returns a duty in [-1, 1], one duty for each wheel, or a `Command`."
        )
    # Later errors of the user's code, during the drive, are reported with the file and the line too.
    return FileController(path, inner)
