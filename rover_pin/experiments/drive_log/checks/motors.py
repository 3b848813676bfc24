"""Checks of wheels and motors in a run: signs of duties, rates and currents, and the declared motor.

Each check is a function of a run and a limit that yields the faults of the run. `log.py` lists all checks with their
limits. A wrong sign refuses a run only if the correlation of two channels cannot be explained by chance
(`is_significant`). If chance may explain it, the fault is only a note, and the search for missing effects uses the
channel unchanged.
"""

from collections.abc import Iterator

import numpy as np

from rover_pin.experiments.drive_log.checks.pose import MAX_ASTRAY, wrong_heading
from rover_pin.experiments.drive_log.checks.run_blocks import (
    MAX_CHANCE,
    MIN_SAMPLES,
    SUSPECT_RATIO,
    Remarks,
    RunBlocks,
    correlation_about_zero,
    independent_blocks,
    is_significant,
)

OPPOSITE = -0.5
"""If the correlation of two channels about zero is below this value, they count as having opposite signs. Channels with
the right signs have a correlation of nearly 1, and noise has one of about 0."""

MAX_CHANCE_OF_NOTE = 1e-3
"""Maximum probability that unrelated series have the observed correlation, if the correlation is to give a note.
(MAX_CHANCE is the limit for refusing a run.)"""

MIN_GAIN_RATIO = 4.0
"""Minimum ratio of each fitted gain of the motor equation to its SD. If both gains exceed it, the equation predicts the
sign of a current. Otherwise the sign of the duty is used."""

CLEAR_CURRENT = 0.02
"""Minimum mean absolute current [A] of a constant current whose sign is meaningful. The zero of a current sensor drifts
by some mA only."""

CLEAR_DUTY = 0.15
"""If the absolute duty [-] is above this value, a turning wheel must turn in the direction of its duty. A smaller duty
may brake a wheel that a slope or the other wheels push."""

MIN_STALL_SHARE = 0.1
"""Minimum current that the motor equation predicts, as a fraction of the stall current, if a measured current is to be
compared with it. At smaller currents, friction and the error of the tachogenerator are as large as the current
(assumed)."""


def wrong_wheel_signs(run: RunBlocks, limit: float) -> Remarks:
    """Yield the wheel channels of a run whose sign is certainly wrong.

    Duty and wheel rate, current and duty, and wheel rate and travel must have equal signs. `limit` (OPPOSITE) is the
    correlation about zero; two channels with a smaller correlation have opposite signs.
    """
    yield from ((what, todo) for what, todo, is_certain in _wheel_signs(run, limit) if is_certain)


def doubtful_current_signs(run: RunBlocks, limit: float) -> Remarks:
    """Yield the currents of a run whose sign is opposite to the sign of their duty, if chance may explain this.

    The search for missing effects compares these currents unchanged, so the reader is asked to check them. `limit`
    (OPPOSITE) is the correlation about zero; two channels with a smaller correlation have opposite signs.
    """
    yield from ((what, todo) for what, todo, is_certain in _wheel_signs(run, limit) if not is_certain)


def _wheel_signs(run: RunBlocks, limit: float) -> Iterator[tuple[str, str, bool]]:
    """Yield (fault, remedy, whether the fault is certain) for each channel whose sign is opposite to the sign of its
    reference channel.

    Two channels have opposite signs if their correlation about zero is below `limit`.
    """
    drawn = _drawn_current(run)
    # With a wrong heading, all wheels run against the travel. Then only the heading is reported (`wrong_heading`).
    is_astray = run.trace.rate_driven and any(wrong_heading(run, MAX_ASTRAY))

    def opposes(a: np.ndarray, b: np.ndarray, use: np.ndarray) -> bool:
        return correlation_about_zero(np.where(use, a, np.nan), b) < limit

    for i, wheel in enumerate(run.trace.wheels):
        current, duty, rate = f"current_{wheel}_A", run.duty[:, i], run.rate[:, i]
        # While a wheel does not turn, its rate is noise and offset, with any sign. While it turns at a clear duty, it
        # turns in the direction of the duty.
        turns = np.abs(rate) > run.still
        if run.trace.rate_driven:
            if not is_astray and opposes(rate, run.speed, turns):
                todo = f"multiply wheel_rate_{wheel} by -1: positive is forward"
                yield f"wheel_rate_{wheel} runs against the travel", todo, True
        elif opposes(duty, rate, turns & (np.abs(duty) > CLEAR_DUTY)):
            # The tracked travel decides which of the two channels is wrong.
            is_rate = opposes(rate, run.speed, turns)
            wrong, reference = ("wheel_rate", "duty") if is_rate else ("duty", "wheel_rate")
            todo = f"multiply {wrong}_{wheel} by -1: positive is forward"
            yield f"{wrong}_{wheel} runs against {reference}_{wheel}", todo, True
            continue
        measured = run.mean(run.trace[current]) if current in run.trace else np.full(len(duty), np.nan)
        if run.trace.rate_driven or not correlation_about_zero(drawn[:, i], measured) < limit:
            continue
        # A current is certainly reversed if its changes oppose those of the drawn current beyond chance, or if it is
        # the current of the declared motor with the other sign, within SUSPECT_RATIO. The second test needs blocks in
        # which the motor draws much: near the rate without load, friction and offsets are as large as the current.
        is_reversed_motor = False
        if (motor := run.declared.whole_motor) is not None:
            expected = np.asarray(motor.drive(duty, rate).current)
            min_current = MIN_STALL_SHARE * float(motor.supply / motor.resistance)
            use = np.isfinite(measured) & (np.abs(expected) > min_current)
            ratio = float(np.median(measured[use] / expected[use])) if np.sum(use) >= MIN_SAMPLES else 0.0
            is_reversed_motor = -SUSPECT_RATIO < ratio < -1.0 / SUSPECT_RATIO
        if is_reversed_motor or _is_reversed(drawn[:, i], measured, MAX_CHANCE):
            yield f"{current} runs against duty_{wheel}", "multiply the current by -1: positive drives forward", True
        elif float(np.nanmean(np.abs(measured))) > CLEAR_CURRENT or _is_reversed(
            drawn[:, i], measured, MAX_CHANCE_OF_NOTE
        ):
            what = f"{current} runs against duty_{wheel} on average, but chance or a wrong zero may cause this"
            yield what, "check the zero and the sign of the channel; the loop compares it unchanged", False


def _is_reversed(drawn: np.ndarray, measured: np.ndarray, max_chance: float) -> bool:
    """Return whether a measured current certainly has the wrong sign: it decreases when the motor should draw more
    current.

    Both currents are block means (blocks,). Only their changes from block to block are correlated. The zero of a
    current sensor drifts slowly by some mA and would correlate with any slow duty by chance, but the changes of such a
    drift are independent of each other.
    """
    # Constant currents have no changes that could be correlated.
    use = np.isfinite(drawn) & np.isfinite(measured)
    expected_change, measured_change = np.diff(drawn[use]), np.diff(measured[use])
    if len(expected_change) < MIN_SAMPLES or min(np.std(expected_change), np.std(measured_change)) == 0.0:
        return False
    correlation = float(np.corrcoef(expected_change, measured_change)[0, 1])
    count = independent_blocks(expected_change, measured_change)
    return correlation < OPPOSITE and is_significant(correlation, count, max_chance)


def _drawn_current(run: RunBlocks) -> np.ndarray:
    """Return the current that each motor should draw (blocks, wheels), in an arbitrary unit, as a duty - b rate with a
    and b > 0.

    The term b rate is needed because a wheel that other wheels push drives its motor as a generator, whose current has
    the opposite sign of the duty. a and b are fitted to the measured currents of all wheels together. If the currents
    do not determine a and b, the duties are returned instead.
    """
    names = [f"current_{wheel}_A" for wheel in run.trace.wheels]
    unknown = np.full(len(run.duty), np.nan)
    means = [run.mean(run.trace[name]) if name in run.trace else unknown for name in names]
    table, current = np.column_stack([run.duty.ravel(), -run.rate.ravel()]), np.column_stack(means).ravel()
    use = np.isfinite(table).all(axis=1) & np.isfinite(current) & np.repeat(run.steady, len(names))
    gains, residual_sum, rank, _ = np.linalg.lstsq(table[use], np.where(use, current, 0.0)[use], rcond=None)
    if rank < 2 or np.sum(use) < MIN_SAMPLES:
        return run.duty
    sd = np.sqrt(np.diag(np.linalg.inv(table[use].T @ table[use])) * float(residual_sum[0]) / (np.sum(use) - 2))
    # If both gains are negative, all currents may be reversed. With positive gains, each current then opposes its duty.
    # Gains of different signs contradict the motor equation, and small ones are not determined.
    is_determined = np.prod(np.sign(gains)) > 0 and np.all(np.abs(gains) > MIN_GAIN_RATIO * sd)
    return np.asarray((table @ np.abs(gains)).reshape(run.duty.shape)) if is_determined else run.duty


def racing_wheels(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the wheels turn more than `limit` times as fast as the declared motor would without load.

    The rate without load is the duty times the no-load rate of the motor. The median over all wheels and steady blocks
    is compared.
    """
    motor = run.declared.motor
    if motor is None or run.trace.rate_driven:
        return
    # Even downhill, a wheel turns little faster than its motor without load.
    duty, rate = np.abs(run.duty[run.steady]), np.abs(run.rate[run.steady])
    use = np.isfinite(duty * rate) & (duty > 0.0)
    if np.sum(use) < MIN_SAMPLES:
        return
    ratio = float(np.median(rate[use] / (duty[use] * float(motor.no_load_rate))))
    if ratio > limit:
        yield f"the wheels turn {ratio:.3g} times as fast as [motor] would at their duty without load", ""


def wrong_supply(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the median battery voltage and the declared supply voltage differ by more than the fraction
    `limit`.
    """
    # The median ignores the sag of the voltage at high currents.
    motor, voltages = run.declared.motor, run.finite("battery_V")
    if motor is None or not voltages.size:
        return
    supply, voltage = float(motor.supply), float(np.median(voltages))
    if abs(voltage - supply) > limit * supply:
        yield f"battery_V is {voltage:.3g} V in the median, but the declared supply is {supply:.3g} V", ""


def currents_beyond_stall(run: RunBlocks, limit: float) -> Remarks:
    """Yield the currents that exceed `limit` times the stall current of the declared motor (supply voltage /
    resistance).
    """
    motor = run.declared.motor
    if motor is None:
        return
    stall = float(motor.supply / motor.resistance)
    for name in (f"current_{wheel}_A" for wheel in run.trace.wheels):
        high = float(np.max(np.abs(run.finite(name)), initial=0.0))
        if high > limit * stall:
            yield f"{name} reaches {high:.3g} A, {high / stall:.2g} times the declared motor's stall current", ""


def currents_off_the_motor(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the measured currents differ from the currents of the declared motor by more than the factor
    `limit`.

    Currents in mA or in counts of a converter differ by such a factor. The median ratio over all wheels is compared, in
    steady blocks with a predicted current of more than MIN_STALL_SHARE of the stall current.
    """
    motor = run.declared.whole_motor
    if motor is None or run.trace.rate_driven:
        return
    # The empty array lets the ratios be joined if no wheel has a current.
    ratios = [np.zeros(0)]
    for i, wheel in enumerate(run.trace.wheels):
        if f"current_{wheel}_A" in run.trace:
            # Signs are checked elsewhere, so only the sizes are compared here.
            drawn = np.abs(motor.drive(run.duty[:, i], run.rate[:, i]).current)
            measured = np.abs(run.mean(run.trace[f"current_{wheel}_A"]))
            min_current = MIN_STALL_SHARE * float(motor.supply / motor.resistance)
            use = run.steady & (drawn > min_current) & np.isfinite(measured)
            ratios.append(measured[use] / drawn[use])
    joined = np.concatenate(ratios)
    if joined.size >= MIN_SAMPLES and not 1.0 / limit <= (ratio := float(np.median(joined))) <= limit:
        yield (
            f"the currents are {ratio:.2g} times the current that [motor] draws at these duties and rates, "
            "(duty V - K rate) / R",
            "",
        )


def travel_against_wheels(run: RunBlocks, limit: float) -> Remarks:
    """Yield the fraction of the driven time with opposite directions of rims and rover, if it exceeds `limit`."""
    rim, speed = run.rim[run.steady], run.speed[run.steady]
    slower = np.minimum(np.abs(rim), np.abs(speed))
    # Both speeds must be clearly above their noise: otherwise their signs mean nothing.
    is_clear = np.isfinite(slower) & (slower > 0.2 * np.nanmax(np.abs(run.rim), initial=0.0))
    share = float(np.sum(is_clear & (rim * speed < 0.0))) / max(rim.size, 1)
    if rim.size >= MIN_SAMPLES and share > limit:
        yield f"the rover travels against its wheels in {100 * share:.0f} % of the driven time", ""


def negative_slip(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the median slip is below `limit` (a negative number), so that the rover travels faster than its
    rims.
    """
    slip = run.slip
    if slip.size >= MIN_SAMPLES and float(np.median(slip)) < limit:
        yield f"the rover travels faster than its rims turn (slip {np.median(slip):.2f} in the median)", ""
