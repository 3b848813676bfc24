"""Measured samples that come with the package, found by name from any folder."""

from importlib.resources import files
from pathlib import Path

from rover_pin.base.errors import closest
from rover_pin.base.files.paths import exists


def sample_folder() -> Path:
    """Return the folder of the samples: inside an installed package, or beside it in a checkout."""
    package = Path(str(files("rover_pin")))
    inside = package / "samples"
    return inside if inside.is_dir() else package.parent / "studies" / "data"


def sample_names() -> list[str]:
    """Return the names of the samples."""
    return sorted(folder.name for folder in sample_folder().iterdir() if folder.is_dir())


def data_path(location: str | Path) -> Path:
    """Return where data lie: `location` if it exists, else the sample, or its file, of this name, else `location`."""
    path = Path(location)
    sample = sample_folder() / path
    is_named = path.parts and not path.is_absolute() and ".." not in path.parts
    return sample if is_named and not exists(path) and exists(sample) else path


def closest_samples(location: str | Path) -> str:
    """Return the tail of an unknown-data message: which sample a name may have meant; of a path or a folder nothing."""
    path = Path(location)
    return f" Of samples {closest(path, sample_names())}" if len(path.parts) == 1 and not exists(path) else ""
