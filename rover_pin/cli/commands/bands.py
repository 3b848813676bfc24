"""`rover-pin drive --model FOLDER`: drives a scenario on all models of a folder and plots quantiles of the results.

The models are equally probable, for example the posterior of a close-loop run.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_pin.base.errors import ParameterError

if TYPE_CHECKING:
    from rover_pin.scenarios.assumptions import Assumption


def bands(
    name: str, folder: Path, settings: dict[str, Any], out: Path, engine: str
) -> "tuple[dict[str, Any], tuple[Assumption, ...]]":
    """Drive a scenario on each model of a folder, write bands.csv and bands.png, and return a summary over the models
    and the assumptions about everything that the models do not state.

    `name` is the scenario, `settings` are the user's settings of the drive, `out` is the folder of the results, and
    `engine` is the name of the engine that computes the steps.
    """
    from rover_pin.comparison.bands import drive_on_models
    from rover_pin.plot import save, write_csv
    from rover_pin.plot.bands import bands_figure
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.simulation.model.toml_file import models_of

    files = models_of(folder)
    # The models replace the single model of the settings.
    drive_settings = {key: value for key, value in settings.items() if key != "model"}
    drives = drive_on_models(name, files, drive_settings, engine=engine)
    title = (
        f"{name} on {len(files)} models of {folder.name}: stuck on {sum(drives.stuck)}, buried on {sum(drives.buried)}"
    )
    paths = [
        write_csv(drives.table(), out / "bands.csv"),
        save(bands_figure(drives.t, drives.panels, title), out / "bands.png"),
    ]
    assumptions = scenario(name, **{**drive_settings, "model": str(files[0])}).assumptions
    return {"scenario": name, **drives.summary(), "files": list(map(str, paths))}, assumptions


def refuse_of_one_model(views: list[str], folder: Path) -> None:
    """Check that the user requests no page, GIF, film or drive file of a folder of models, because these hold a single
    drive.

    `views` are the names of the requested files, and `folder` is the folder of models.

    Raises ParameterError: `views` is not empty.
    """
    if views:
        raise ParameterError(
            f"a page, GIF, film or drive file holds a single drive, but {folder} is a folder of models: give --model "
            "one of its files."
        )
