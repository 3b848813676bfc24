"""Optional packages: the requirements of each extra of pyproject.toml, and the command that installs them.

No package called rover-pin is published on an index. A line such as `pip install 'rover-pin[dem]'` would therefore fail
today, and could later run the code of anyone who registers that name. Therefore no message of this package prints such
a line.
"""

from rover_pin.base.errors import one_of

EXTRAS = {
    "cluster": ("dask[distributed]>=2024.1",),
    "dem": ("rasterio>=1.4",),
    "compiler": ("ziglang>=0.13",),
    "control": ("control>=0.10",),
    "ros": ("rosbags>=0.11.6",),
    "view": ("viser>=1.0",),
    "mcap": ("mcap>=1.1",),
    "parquet": ("pyarrow>=16",),
    "rerun": ("rerun-sdk>=0.23",),
    "docs": ("mkdocs-material>=9.5", "mkdocstrings[python]>=0.26", "nbconvert>=7", "ipywidgets>=8"),
    "mujoco": ("mujoco>=3.2",),
    "xacro": ("xacrodoc>=2.0",),
    "xarray": ("xarray>=2024.1",),
}
"""Name of an extra (a group of optional packages) -> the requirements of the extra, as in pyproject.toml."""


def install_command(extra: str) -> str:
    """Return the shell command that installs the packages of an extra, which is a group of optional packages.

    The command works for a clone and for an installed package. Messages about a missing package print this command.

    Raises ParameterError: no extra has this name.

    Examples
    --------
    >>> install_command("dem")
    'pip install "rasterio>=1.4"'
    """
    requirements = EXTRAS[one_of("extra", extra, EXTRAS)]
    return " ".join(["pip install", *(f'"{requirement}"' for requirement in requirements)])
