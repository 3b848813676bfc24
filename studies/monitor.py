"""Test the monitor on fresh drives: burials warned of in time, false alarms, and calibration of its probabilities.

Question
    Does the monitor warn of every burial two seconds before it, with five false alarms an hour or fewer, and is P(stuck
    within 4 s) calibrated?
Method
    Drives of 40 s are drawn as in `slip_sensing` (inclines that dig, ditches, slopes that steepen, hills, rocks; soil,
    digging and the rover drawn), at constant duty 0.55, with the sensors' noise, from seeds on which nothing was
    chosen. The monitor was developed on the seeds 291001 and 291002. A rover is stuck while its wheels travel less than
    a tenth of the distance that their rims turn during the next radius r of rim travel (`DriveOutcome`). A rover is
    buried when a wheel sinks by half its radius. An alarm lasts while the smoothed P(stuck) is above a level, until it
    is below half of the level. An alarm is false if the rover is neither stuck nor buried at any time within 4 s (8 s)
    of its start. A burial is warned of by the first true alarm from 4 s before the rover was last stuck. Brier score,
    reliability and AUC compare P at every fourth sample with the event: the rover is stuck (buried) at any time within
    4 s.
Result
    300 drives, 2.75 h, 99 burials, 137 times stuck. At the alarm level 0.75, 89 burials are warned of 2 s before
    (minimum lead 0.4 s, median 3.3 s) with 2.2 false alarms an hour; at 0.6, 95 with 9. The target, all burials with a
    maximum of 5 an hour, is missed, and no level warns of all burials. Stuck: Brier 0.056 (share 0.18; target 0.05),
    AUC 0.89, and 0.70 before the rover is stuck. Buried: 0.040 (share 0.040), 0.88.
    Other fresh seeds, 291201 to 291203 and 291301 to 291303: 82 of 89 and 69 of 79 with 2.8 and 3.8 false alarms an
    hour, Brier 0.051 and 0.048. Since then P(buried) weighs digging by distance. On 291001 and 291002 its Brier score
    fell from 0.043 to 0.034 (share 0.034), mainly in ditches that do not dig. The alarms are unchanged.
What the paper says
    The paper has no monitor; its rover is "stuck" at S = 1.
What differs
    The whole study is beyond the paper.
Run: python studies/monitor.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from slip_sensing import Case, built, drawn, said

from rover_pin import plot
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.onboard.monitor.monitor import Monitor
from rover_pin.onboard.monitor.source import ALARM, HORIZON
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.outcome.outcome import MIN_TRAVEL_RATIO
from rover_pin.simulation.sensors import NoisyController, Sensors
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning.evaluations import Evaluations

SEEDS = (291_401, 291_402, 291_403)
"""Seeds of the drives and of their noise. Nothing was chosen on them."""
ROUNDS, DURATION = 10, 40.0
LEVELS = (0.4, 0.5, 0.6, 0.7, ALARM, 0.8, 0.9)
LEAD = 2.0
"""Required time from the warning to the burial [s]."""
EVERY = 4
"""Number of samples from one scored forecast to the next: only every EVERY-th forecast enters the scores."""
EDGES = (0.0, 0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01)


class Drive(NamedTuple):
    """A simulated drive, with the output of the monitor over time and the events that the monitor should forecast. The
    monitor is the on-board program that forecasts whether the rover gets stuck or buried.
    """

    kind: str
    seed: int
    end: float
    buried: bool
    stuck: np.ndarray
    """Start and end of each period in which the rover is stuck (n, 2) [s]."""
    said: np.ndarray
    """forecasts of the monitor (samples, 4): time t [s], P(stuck), P(buried), and smoothed P(stuck)."""

    def comes(self, t: float, horizon: float) -> bool:
        """Return whether the rover is stuck or buried at any time within `horizon` [s] after t."""
        stuck = np.any((self.stuck[:, 0] <= t + horizon) & (self.stuck[:, 1] >= t))
        return bool(stuck or self.buries(t, horizon))

    def buries(self, t: float, horizon: float) -> bool:
        """Return whether a wheel is buried within `horizon` [s] after t."""
        return self.buried and self.end - t <= horizon

    def alarms(self, level: float) -> list[float]:
        """Return the times at which alarms are raised at a level [s]."""
        begins, raised = [], False
        # Hysteresis: an alarm ends only below half of its level, so that noise does not raise it again.
        for t, p in self.said[:, [0, 3]].tolist():
            if not raised and p > level:
                begins.append(t)
            raised = p > (0.5 * level if raised else level)
        return begins


def main() -> None:
    """Simulate all drives with the monitor running, score its forecasts, and write and print the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="three short drives: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/monitor"))
    parser.add_argument("--workers", type=int, default=0, help="processes; 0 for all cores")
    # Every drive has its own noise seed.
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cases = [(case, seed + at) for seed in SEEDS for at, case in enumerate(drawn(ROUNDS, DURATION, seed))]
    if options.quick:
        cases = [(case, at) for at, case in enumerate(drawn(1, 12.0, SEEDS[0])[2:5])]
    evaluations = Evaluations(options.out, options.workers or None, said)
    drives = [
        unpacked(case, seed, row)
        for (case, seed), row in zip(cases, evaluations.run("drives", watched, cases), strict=True)
    ]
    # Alarms by level, then scores of the probabilities, which do not depend on a level.
    table = pd.DataFrame([at_level(drives, level) for level in LEVELS])
    for event in ("stuck", "buried"):
        p, came, _ = outcomes(drives, event)
        table[f"brier_{event}"], table[f"share_{event}"] = np.mean((p - came) ** 2), came.mean()
    bins = pd.concat([reliability(drives, event) for event in ("stuck", "buried")])
    plot.write_csv(table, options.out / "monitor.csv")
    plot.write_csv(bins, options.out / "reliability.csv")
    figure(table, bins, options.out)
    print(report(drives, table, bins))
    print(f"written: {options.out}/monitor.csv, reliability.csv, monitor.png")


class Beside:
    """A controller with constant duty that runs a monitor and records its output."""

    def __init__(self, monitor: Monitor):
        self.monitor, self.inner = monitor, ConstantDuty()
        self.reset()

    def reset(self) -> None:
        """Reset the monitor and clear the record."""
        self.monitor.reset()
        self.rows: list[tuple[float, ...]] = []

    def __call__(self, reading: Reading) -> Command:
        """Run the monitor on the reading and return the constant duty."""
        forecast = self.monitor.step(reading)
        self.rows.append((reading.t, forecast.p_stuck, forecast.p_buried, self.monitor.struct.smoothed))
        return self.inner(reading)


def watched(case: Case, seed: int) -> list[float]:
    """Simulate a drive with the monitor, and return the results as a flat list of numbers: end of the drive [s],
    whether a wheel was buried, number of periods of being stuck, start and end of these periods, and the forecasts of
    the monitor.
    """
    # The monitor reads noisy sensors, like a monitor on a real rover.
    scene = built(case)
    beside = Beside(Monitor.of(scene.model))
    trace = simulate(
        scene.model,
        NoisyController(beside, Sensors(), seed),
        scene.duration,
        scene.start,
        scene.timing,
        measure_error=False,
    )
    spans = stuck_spans(trace, float(scene.model.rover.wheel.r))
    buried = str(trace.attrs["stop"]).startswith("buried")
    # A flat list of numbers, which the evaluation cache can store.
    return [
        float(trace.t[-1]),
        float(buried),
        float(len(spans)),
        *spans.ravel().tolist(),
        *np.ravel(beside.rows).tolist(),
    ]


def unpacked(case: Case, seed: int, row: list[float]) -> Drive:
    """Return the Drive that `watched` packed into a list."""
    end, buried, count = row[:3]
    spans, rows = np.split(np.array(row[3:]), [2 * int(count)])
    return Drive(case.kind, seed, end, bool(buried), spans.reshape(-1, 2), rows.reshape(-1, 4))


def stuck_spans(trace: Trace, r: float) -> np.ndarray:
    """Return start and end of each period in which a rover is stuck (n, 2) [s]."""
    dt = np.diff(trace.t, prepend=trace.t[:1])
    # Rim travel and wheel travel, each as the mean over wheels [m].
    turned = np.cumsum(np.mean(np.abs(r * trace.stack("wheel_rate")), axis=1) * dt)
    travelled = np.cumsum(np.mean(trace.stack("travel"), axis=1) * dt)
    # Only rows that are followed by a full radius of rim travel can be evaluated.
    begin = np.flatnonzero(turned <= turned[-1] - r)
    end = np.searchsorted(turned, turned[begin] + r)
    stands = travelled[end] - travelled[begin] < MIN_TRAVEL_RATIO * (turned[end] - turned[begin])
    stuck = np.zeros(len(trace.t) + 2, dtype=int)
    for first, last in zip(begin[stands], end[stands], strict=True):
        stuck[first + 1 : last + 2] = 1
    edges = np.diff(stuck)
    return np.column_stack([trace.t[np.flatnonzero(edges == 1)], trace.t[np.flatnonzero(edges == -1) - 1]])


def at_level(drives: list[Drive], level: float) -> dict[str, Any]:
    """Return the scores of the alarms that are raised above one level of the probability: burials with a warning in
    time, warning times, detected periods of being stuck, and false alarms per hour.
    """
    hours, leads, caught, stuck, false = sum(drive.end for drive in drives) / 3600.0, [], 0, 0, [0, 0]
    for drive in drives:
        begins = drive.alarms(level)
        # An alarm is true if the rover is stuck or buried within the horizon of the forecast.
        true = [t for t in begins if drive.comes(t, HORIZON)]
        false[0] += len(begins) - len(true)
        false[1] += sum(not drive.comes(t, 2.0 * HORIZON) for t in begins)
        stuck += len(drive.stuck)
        caught += sum(any(begin - HORIZON <= t <= end for t in true) for begin, end in drive.stuck)
        # Only alarms since the rover was last stuck, minus the horizon, count as warnings of the burial.
        if drive.buried:
            since = drive.stuck[-1, 0] if len(drive.stuck) else drive.end
            leads.append(drive.end - min((t for t in true if t >= since - HORIZON), default=drive.end))
    quantiles = np.quantile(leads, [0.0, 0.1, 0.5]) if leads else np.full(3, np.nan)
    return {
        "level": level, "drives": len(drives), "hours": hours, "burials": len(leads),
        "warned": sum(lead >= LEAD for lead in leads), "lead_least_s": quantiles[0], "lead_10_s": quantiles[1],
        "lead_median_s": quantiles[2], "stuck": stuck, "caught": caught, "false_per_hour": false[0] / hours,
        "false_8s_per_hour": false[1] / hours,
    }  # fmt: skip


def outcomes(drives: list[Drive], event: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three arrays, with an entry for every EVERY-th sample: the forecast probability P, whether the event
    followed, and whether the rover was not yet stuck.
    """
    rows = []
    for drive in drives:
        for t, p_stuck, p_buried, _ in drive.said[::EVERY].tolist():
            # The event counts if it occurs within the horizon of the forecast.
            came = drive.comes(t, HORIZON) if event == "stuck" else drive.buries(t, HORIZON)
            rows.append((p_stuck if event == "stuck" else p_buried, came, not drive.comes(t, 0.0)))
    p, came, before = np.array(rows).T
    return p, came > 0.0, before > 0.0


def reliability(drives: list[Drive], event: str) -> pd.DataFrame:
    """Return a table of the reliability: for each class of the forecast probability P, the observed share of samples
    that the event followed.
    """
    p, came, _ = outcomes(drives, event)
    bins = np.digitize(p, EDGES) - 1
    rows = [(event, p[bins == i].mean(), came[bins == i].mean(), int(np.sum(bins == i))) for i in np.unique(bins)]
    return pd.DataFrame(rows, columns=["event", "said", "came", "samples"])


def auc(p: np.ndarray, came: np.ndarray) -> float:
    """Return the probability that P is greater before the event than without it; ties count half."""
    ranks, many = pd.Series(p).rank().to_numpy(), int(came.sum())
    pairs = many * (len(p) - many)
    return float((ranks[came].sum() - many * (many + 1) / 2) / pairs) if pairs else float("nan")


def report(drives: list[Drive], table: pd.DataFrame, bins: pd.DataFrame) -> str:
    """Return the tables as text."""
    hours, burials, stuck = table.loc[0, ["hours", "burials", "stuck"]]
    lines = [f"{len(drives)} drives, {hours:.2f} h, {burials:.0f} burials, {stuck:.0f} times stuck"]
    # The Brier score before the rover is stuck is the harder test, because the event is not visible yet.
    for event in ("stuck", "buried"):
        p, came, before = outcomes(drives, event)
        briers = [f"{np.mean((p - came)[rows] ** 2):.4f}" for rows in (slice(None), before)]
        lines.append(
            f"{event} within {HORIZON:g} s: Brier {briers[0]} (share {came.mean():.3f}), before {briers[1]}; "
            f"AUC {auc(p, came):.3f}, before {auc(p[before], came[before]):.3f}"
        )
    lines.append(
        "said / came: " + ", ".join(f"{r.event} {r.said:.2f} / {r.came:.2f} ({r.samples})" for r in bins.itertuples())
    )
    for row in table.itertuples():
        lines.append(
            f"level {row.level:.2f}: {row.warned} of {row.burials} burials warned {LEAD:g} s before, lead least "
            f"{row.lead_least_s:.1f}, 10 % {row.lead_10_s:.1f}, median {row.lead_median_s:.1f} s; "
            f"{row.caught} of {row.stuck} stuck; "
            f"false an hour {row.false_per_hour:.1f} (4 s), {row.false_8s_per_hour:.1f} (8 s)"
        )
    # Drives whose burial comes without a timely warning, for a closer look.
    late = [
        f"{drive.kind} {drive.seed}" for drive in drives if drive.buried and at_level([drive], ALARM)["warned"] == 0
    ]
    return "\n".join([*lines, f"not warned {LEAD:g} s before at {ALARM:g}: {', '.join(late) or 'none'}"])


def figure(table: pd.DataFrame, bins: pd.DataFrame, out: Path) -> None:
    """Draw two panels: the share of burials with a warning in time against the number of false alarms per hour, and the
    observed frequency of events against the forecast probability.
    """
    sheet, (left, right) = plot.new_figure(1, 2, size=(9.5, 4.2))
    for column, label, colour in (
        ("false_per_hour", "within 4 s", plot.COLOURS[0]),
        ("false_8s_per_hour", "within 8 s", plot.COLOURS[1]),
    ):
        left.plot(table[column], 100.0 * table.warned / table.burials.clip(lower=1), "o-", color=colour, label=label)
    left.set(xlabel="false alarms an hour", ylabel="burials warned 2 s before [%]")
    for (event, rows), colour in zip(bins.groupby("event", sort=False), plot.COLOURS, strict=False):
        right.plot(rows.said, rows.came, "o-", color=colour, label=event)
    # The diagonal is perfect calibration.
    right.plot([0, 1], [0, 1], color="0.6", lw=0.8)
    right.set(xlabel="P said", ylabel="share that came")
    for axis in (left, right):
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    plot.save(sheet, out / "monitor.png")


if __name__ == "__main__":
    main()
