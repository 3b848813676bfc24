"""A term: what acts times what it depends on, fitted; its gain, its curve, and one sentence about it."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.profile import CLEAR
from rover_pin.estimation.wording import spread
from rover_pin.experiments.drive_log.checks.columns import stretches
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE, Act
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial, Wave

UNTOLD = 0.01
"""SD over the greatest below which a value of such a function is not identified at all: no row depends on it."""
GRIP_VARIABILITY = 0.03
"""RMS by which the grip of sand that is prepared anew differs from run to run and along the way (assumed)."""


class Curve(NamedTuple):
    """The estimated function on a grid, with SDs; (G,) or, where every run has its own, (runs, G)."""

    at: np.ndarray
    value: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Term:
    """One term fitted to the rows: `size` are the numbers of its columns, by run where each has its own."""

    act: Act = field(repr=False)
    argument: Argument = field(repr=False)
    runs: tuple[str, ...]
    size: np.ndarray
    covariance: np.ndarray = field(repr=False)
    gain: float
    "fall of the robust chi2"
    detection_threshold: float
    "what chance gives the best of all terms with as many columns"
    held_out: float | None
    "fall of chi2 of runs on which its numbers were not fitted; None where every run has its own"

    @property
    def net(self) -> float:
        """Gain beyond what chance gives."""
        return self.gain - self.detection_threshold

    @property
    def curve(self) -> Curve:
        """The estimated function, in the act's unit."""
        grid = self.argument.basis.grid
        basis = self.argument.basis.of(grid)
        k = len(basis)
        runs = len(self.size) // k
        values = np.array([self.size[k * run : k * run + k] @ basis for run in range(runs)])
        spans = [slice(k * run, k * run + k) for run in range(runs)]
        sds = np.array(
            [np.sqrt(np.maximum(np.einsum("ig,ij,jg->g", basis, self.covariance[s, s], basis), 0)) for s in spans]
        )
        return Curve(grid, values if self.argument.per_run else values[0], sds if self.argument.per_run else sds[0])

    @property
    def strength(self) -> float:
        """Net gain, no more than it holds in runs on which it was not fitted."""
        return self.net if self.held_out is None else min(self.net, self.held_out)

    @property
    def is_raking(self) -> bool:
        """Whether it is no more than prepared sand differs by: a small change of grip, another in each run."""
        if self.act.kind != GRIP or not self.argument.per_run:
            return False
        curve = self.curve
        return float(np.sqrt(np.mean(curve.value[curve.sd > 0] ** 2))) < GRIP_VARIABILITY

    @property
    def description(self) -> str:
        """What it acts as, what it depends on, its size and where, in one sentence."""
        return f"acts as {self.act.description}{_describe_term(self)}"


def _describe_term(term: Term) -> str:
    """Return what a term depends on, its size and where, as they follow what it acts as."""
    name, basis = term.argument.name, term.argument.basis
    curve = term.curve
    if name == "nothing":
        return f": {_size(term, curve.value[0], curve.sd[0])} all the time"
    if name == "run":
        by_run = (f"{_size(term, row[0])} in {run}" for run, row in zip(term.runs, curve.value, strict=True))
        return f" that differs from run to run: {', '.join(by_run)}"
    if isinstance(basis, Wave):
        return f" {_wave(term, basis, curve)}"
    if isinstance(basis, Hats):
        return f" {_places(term, curve)}"
    assert isinstance(basis, Polynomial)
    return f" that depends on {_of(name)}: {_ends(term, curve)}"


def _of(name: str) -> str:
    return {
        "rate": "the wheel's rate",
        "duty": "the duty",
        "slip": "the slip",
        "current": "the motor's current",
        "pitch": "the pitch",
        "roll": "the roll",
        "time": "the time since the run began",
        "place": "the place along x",
        "heading": "the heading (its cosine)",
    }.get(name, name)


def _size(term: Term, value: float, sd: float | None = None) -> str:
    """Return a value with its unit; shares in percent."""
    unit, scale = term.act.unit, 1.0
    if not unit:
        unit, scale = (
            ("%" if term.act.kind != VOLTAGE else "of full duty"),
            (100.0 if term.act.kind != VOLTAGE else 1.0),
        )
    spread_text = "" if sd is None else spread(scale * sd)
    return f"{scale * value:+.3g}{spread_text} {unit}"


def sine(term: Term) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitudes and phases [rad] of a wave, one for each run or one for all: A sin(2 pi x / L + phase)."""
    pairs = term.size.reshape(-1, 2)
    return np.hypot(*pairs.T), np.arctan2(pairs[:, 1], pairs[:, 0])


def _wave(term: Term, basis: Wave, curve: Curve) -> str:
    amplitude, phase = sine(term)
    size = _size(term, float(np.mean(amplitude)), float(np.max(curve.sd))).lstrip("+")
    if term.argument.name == "periodic place":
        return f"that varies with the place, wavelength {basis.length:.2f} m: amplitude {size}"
    twice = "twice " if basis.length < 2 * math.pi - 1e-9 else ""
    first = f"that depends on {twice}the angle of the wheel"
    if term.argument.per_run:
        return f"{first}: amplitude {size}, its phase differs from run to run"
    return f"{first} since the start of the run: amplitude {size}, phase {math.degrees(phase[0]):.0f} deg"


class Stretch(NamedTuple):
    """Where a piecewise linear function stands out from its median: from, to, the extreme, its SD."""

    low: float
    high: float
    top: float
    sd: float


def clear_stretches(curve: Curve, row: int | None) -> list[Stretch]:
    """Return where a piecewise linear function is clear of its median, the clearest first.

    Its level is left out: a resistance or a motor's gain takes that.
    """
    value, sd = (curve.value, curve.sd) if row is None else (curve.value[row], curve.sd[row])
    identified = sd > UNTOLD * float(np.max(sd))
    value = value - (np.median(value[identified]) if identified.any() else 0.0)
    clear = identified & (np.abs(value) > CLEAR * sd)
    clear_parts, half = [], (curve.at[1] - curve.at[0]) / 2
    for sign in (1, -1):
        for begin, end in stretches(clear & (np.sign(value) == sign)):
            top = begin + np.argmax(np.abs(value[begin:end]) / sd[begin:end])
            low, high = max(curve.at[begin] - half, curve.at[0]), min(curve.at[end - 1] + half, curve.at[-1])
            clear_parts.append(Stretch(low, high, float(value[top]), float(sd[top])))
    return sorted(clear_parts, key=lambda stretch: -abs(stretch.top / stretch.sd))


def _places(term: Term, curve: Curve) -> str:
    letter, unit = ("x", "m") if term.argument.unit == "m" else ("t", "s")
    rows: list[int | None] = list(range(len(curve.value))) if term.argument.per_run else [None]
    located = [(row, stretch) for row in rows for stretch in clear_stretches(curve, row)]
    located.sort(key=lambda pair: -abs(pair[1].top / pair[1].sd))
    kind = "the place along x" if letter == "x" else "the moment"
    listed = [
        f"{_size(term, top, sd)} at {letter} = {low:.2f}..{high:.2f} {unit}"
        + ("" if row is None else f" in {term.runs[row]}")
        for row, (low, high, top, sd) in located[:3]
    ]
    return f"that depends on {kind}: {'; '.join(listed) or 'nowhere clear of 0'}"


def _ends(term: Term, curve: Curve) -> str:
    unit = f" {term.argument.unit}" if term.argument.unit else ""
    if term.act.kind == READING and term.argument.name == "its own value":
        zero, gain = term.size
        return f"{_size(term, zero)} and {100 * gain:+.2g} % of the reading"
    at = [0, len(curve.at) // 2, len(curve.at) - 1]
    return ", ".join(f"{_size(term, curve.value[i], curve.sd[i])} at {curve.at[i]:.3g}{unit}" for i in at)
