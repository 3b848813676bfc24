"""A drive on all models of a folder, as a loop leaves them in `posterior`: bands in place of lines."""

from pathlib import Path
from typing import Any

from rover_pin.base.errors import ParameterError


def bands(name: str, folder: Path, settings: dict[str, Any], out: Path) -> dict[str, Any]:
    """Drive a scenario on each model, write bands.csv and bands.png, and return what the models say of it."""
    from rover_pin.comparison.bands import drive_on_models
    from rover_pin.plot import save, write_csv
    from rover_pin.plot.bands import bands_figure
    from rover_pin.simulation.model.toml_file import models_of

    files = models_of(folder)
    drives = drive_on_models(name, files, {key: value for key, value in settings.items() if key != "model"})
    title = (
        f"{name} on {len(files)} models of {folder.name}: stuck on {sum(drives.stuck)}, buried on {sum(drives.buried)}"
    )
    paths = [
        write_csv(drives.table(), out / "bands.csv"),
        save(bands_figure(drives.t, drives.panels, title), out / "bands.png"),
    ]
    return {"scenario": name, **drives.summary(), "files": list(map(str, paths))}


def refuse_of_one_model(views: list[str], folder: Path) -> None:
    """Refuse what is of one drive."""
    if views:
        raise ParameterError(f"a view: {folder} is a folder of models; name one of its files for that.")
