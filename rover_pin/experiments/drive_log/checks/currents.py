"""Motor currents against the declared motor: their scale."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import Driven
from rover_pin.experiments.drive_log.checks.units import AT_LEAST
from rover_pin.measurements.finding import Finding
from rover_pin.simulation.model.motor import Motor

TELLING = 0.1
"""Share of the stall current from which the motor's equation tells the current."""
OFF, FAR_OFF = 3.0, 20.0
"""Times, either way, that currents may be off the motor's before they are named, and refused."""


def current_faults(run: Driven, motor: Motor) -> Iterator[Finding]:
    """Yield currents whose scale cannot be the motor's; raw counts or another unit."""
    times = _times(run, motor)
    if times is not None and not 1.0 / FAR_OFF <= times <= FAR_OFF:
        yield Finding(_scale_message(times), run.name, "give amperes, or leave the currents out")


def current_findings(run: Driven, motor: Motor) -> Iterator[Finding]:
    """Yield currents that are hardly the motor's."""
    times = _times(run, motor)
    if times is not None and not 1.0 / OFF <= times <= OFF:
        yield Finding(
            _scale_message(times), run.name, "check their scale, and supply, resistance, k_t and gear of [motor]"
        )


def _scale_message(times: float) -> str:
    return f"the currents are {times:.2g} times what [motor] draws at these duties and rates, (duty V - K rate) / R"


def _times(run: Driven, motor: Motor) -> float | None:
    """Return the measured over the motor's current, the median of all wheels; None where that is not known."""
    ratios: list[np.ndarray] = []
    if run.rate_driven:
        return None
    for i, wheel in enumerate(run.wheels):
        name = f"current_{wheel}_A"
        if name not in run.trace:
            continue
        drawn = np.asarray(motor.drive(run.duty[:, i], run.rate[:, i]).current)
        stall = float(motor.supply / motor.resistance)
        use = run.steady & (np.abs(drawn) > TELLING * stall)
        measured = np.abs(run.mean(run.trace[name]))
        use &= np.isfinite(measured)
        ratios.append(measured[use] / np.abs(drawn[use]))
    finite_ratios = np.concatenate(ratios) if ratios else np.zeros(0)
    return float(np.median(finite_ratios)) if finite_ratios.size >= AT_LEAST else None
