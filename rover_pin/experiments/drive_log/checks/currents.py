"""Motor currents against the declared motor: their scale."""

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import Driven, Remarks
from rover_pin.experiments.drive_log.checks.units import AT_LEAST
from rover_pin.simulation.model.motor import Motor

TELLING = 0.1
"""Share of the stall current from which the motor's equation tells the current."""
OFF, FAR_OFF = 3.0, 20.0
"""Times, either way, that currents may be off the motor's before they are named, and refused."""


def current_faults(run: Driven) -> Remarks:
    """Yield currents whose scale cannot be the motor's; raw counts or another unit."""
    yield from _off_by(FAR_OFF, run, "give amperes, or leave the currents out")


def current_findings(run: Driven) -> Remarks:
    """Yield currents that are hardly the motor's."""
    yield from _off_by(OFF, run, "check their scale, and supply, resistance, k_t and gear of [motor]")


def _off_by(limit: float, run: Driven, todo: str) -> Remarks:
    motor = run.declared.whole_motor
    times = None if motor is None or run.rate_driven else _times(run, motor)
    if times is not None and not 1.0 / limit <= times <= limit:
        drawn = "what [motor] draws at these duties and rates, (duty V - K rate) / R"
        yield f"the currents are {times:.2g} times {drawn}", todo


def _times(run: Driven, motor: Motor) -> float | None:
    """Return the measured over the motor's current, the median of all wheels; None where that is not known."""
    ratios = [np.zeros(0)]
    for i, wheel in enumerate(run.wheels):
        if f"current_{wheel}_A" in run.trace:
            drawn = np.abs(motor.drive(run.duty[:, i], run.rate[:, i]).current)
            measured = np.abs(run.mean(run.trace[f"current_{wheel}_A"]))
            use = run.steady & (drawn > TELLING * float(motor.supply / motor.resistance)) & np.isfinite(measured)
            ratios.append(measured[use] / drawn[use])
    joined = np.concatenate(ratios)
    return float(np.median(joined)) if joined.size >= AT_LEAST else None
