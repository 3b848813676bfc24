"""Several rig sets read as one experiment: each by its name, and a run that is in two of them used once."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.paths import is_file
from rover_pin.base.trust import Trust
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import of_one_sand
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet

SAME_RUN = 0.02
"""Runs of two sets whose loads and channels differ by less than this share of their SDs are one run."""
GIVEN = 0.05
"""The same of slip, slip angle [rad] and the load's share: one where they differ by less than 0.001."""


def join_sets(sets: Sequence[RigSet]) -> RigExperiment:
    """Return several sets as one experiment, runs that are in two of them used once.

    Raises ParameterError: fewer than two sets.
    Raises DataError: two of one name, one of which every run is in another, or two that declare different values of one
    constant of the sand.
    """
    if len(sets) < 2:
        raise ParameterError("A joint fit is of two sets or more; of one, give it alone.")
    named: dict[str, RigSet] = {}
    findings = []
    for data in sets:
        name = data.name
        if name in named:
            raise DataError(f"{name}: two sets have this name; give each its own in its rig.toml.")
        new = ~seen_before(data, named.values())
        if not new.any():
            raise DataError(f"{name}: every run of it is in another set too; leave it out.")
        if not new.all():
            what = f"{int((~new).sum())} of {new.size} runs are in another set too"
            findings.append(Finding(what, name, "they are used once"))
        named[name] = data if new.all() else data.rows(new)
    of_one_sand(tuple(named.values()))
    return RigExperiment(tuple(named.values()), tuple(findings))


def read_joint(folders: Sequence[str | Path], trust: Trust = Trust()) -> RigExperiment:
    """Return the sets of several folders as one experiment.

    Raises ParameterError, DataError: data that are no rig set, and what `read_rig_set` and `join_sets` refuse.
    """
    for folder in folders:
        if not is_file(Path(folder) / RIG_FILE):
            raise DataError(f"{folder}: there is no {RIG_FILE} in it; several data are rig sets in one sand.")
    return join_sets([read_rig_set(folder, trust) for folder in folders])


def seen_before(data: RigSet, others: Iterable[RigSet]) -> np.ndarray:
    """Return which runs stand in another set already: slip, angle, load and channels are the same."""
    duplicate = np.zeros(data.slip.size, dtype=bool)
    for other_set in others:
        mine, theirs = _fingerprint(data, other_set), _fingerprint(other_set, data)
        is_close = np.abs(mine[:, None] - theirs[None]) < SAME_RUN
        duplicate |= (is_close | (np.isnan(mine[:, None]) & np.isnan(theirs[None]))).all(axis=2).any(axis=1)
    return duplicate


def _fingerprint(data: RigSet, other_set: RigSet) -> np.ndarray:
    """Return slip, angle, ln load and the channels of both sets over their SDs (runs, numbers)."""
    mine, theirs = ({type(channel): channel for channel in of.channels} for of in (data, other_set))
    inputs = np.array([data.slip, data.slip_angle, np.log(data.load)]) / GIVEN
    both = (kind for kind in RIG_CHANNELS if kind in mine and kind in theirs)
    return np.vstack([inputs, *(mine[of].measured / (mine[of].sd.mean() + theirs[of].sd.mean()) for of in both)]).T
