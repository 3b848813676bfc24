"""What a log declares of its sensors, as the SD of a half-second mean."""

from collections.abc import Mapping, Sequence

import numpy as np

from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, PATH, SPEED
from rover_pin.logs.declared_noise import SAMPLE_PERIOD, kind_of
from rover_pin.simulation.replay import PERIOD

OF_FEATURES = {PATH: "body_position", DRIFT: "body_position", HEADING: "body_attitude", SPEED: "body_velocity"}


def declared_block_sd(declared: Mapping[str, float], channels: Sequence[str]) -> np.ndarray:
    """Return the SD of a feature's half-second mean (channels,) by declared SDs of samples, NaN where none is.

    Of n samples without memory the mean has sd / sqrt(n); what a way forgets of its beginning is left out.
    """
    samples = max(BLOCK / declared.get(SAMPLE_PERIOD, PERIOD), 1.0)
    kinds = [OF_FEATURES.get(name) or kind_of(name) for name in channels]
    return np.array([declared.get(kind, np.nan) for kind in kinds]) / np.sqrt(samples)
