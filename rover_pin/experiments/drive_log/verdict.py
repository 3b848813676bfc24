"""What the loop found in a drive log: the effect, or the set of effects, or none, with all the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.discrepancy.answer import Answer, plain, score_line
from rover_pin.discrepancy.compare import Refit
from rover_pin.discrepancy.conclusion import DRIFTED, Number
from rover_pin.discrepancy.held_out import ChannelScore, RunScore
from rover_pin.discrepancy.search import Round, Search
from rover_pin.estimation.profile import Profile
from rover_pin.estimation.wording import Outcome
from rover_pin.experiments.drive_log.free_runs import FreeRun
from rover_pin.experiments.drive_log.parameters import owner_name
from rover_pin.experiments.drive_log.separating_drive import SeparatingDrive
from rover_pin.experiments.unlisted.remainder import Remainder
from rover_pin.measurements.finding import Finding
from rover_pin.motion.effect_files import AnyEffect
from rover_pin.motion.model import Model


@dataclass(frozen=True, eq=False)
class DriveVerdict:
    """The result of the loop on a drive log. `model` carries the fitted numbers and effects and drives at once."""

    answer: Answer
    name: str
    "name of the log"
    sentence: str
    model: Model = field(repr=False)
    alike: tuple[str, ...]
    "the candidates that the data cannot tell apart, the best first"
    named: tuple[str, ...]
    "what was added to the base model, or freed in it"
    explained: float
    "share of chi2 beyond the noise that it takes"
    before: tuple[Number, ...] = field(repr=False)
    after: tuple[Number, ...] = field(repr=False)
    scores: tuple[ChannelScore, ...] = field(repr=False)
    free: tuple[FreeRun, ...] = field(repr=False)
    remainder: Remainder | None = field(repr=False)
    findings: tuple[Finding, ...]
    experiments: tuple[SeparatingDrive, ...]
    search: Search | None = field(repr=False)
    provenance: dict[str, Any] = field(repr=False)
    runs: tuple[RunScore, ...] = field(default=(), repr=False)
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    files: tuple[Path, ...] = ()

    @property
    def effects(self) -> tuple[AnyEffect, ...]:
        """The added effects at their fitted values."""
        own = {name.partition("@")[0] for name in self.named}
        return tuple(effect for effect in self.model.all_effects if owner_name(effect) in own)

    @property
    def drifted(self) -> tuple[Number, ...]:
        """Numbers that sit away from what was declared of them."""
        return tuple(one for one in self.after if abs(one.drift) > DRIFTED)

    @property
    def model_said(self) -> str:
        """What `model` is, in words."""
        if self.search is None:
            return "the base model as the log declares it, nothing fitted"
        added = " + ".join(self.named)
        return f"the model with {added}" if added else "the fitted base model, to which nothing was added"

    def summary(self) -> str:
        """Return the verdict in a page of text; angles in degrees."""
        lines = [f"{self.name}: {self.answer.value}", f"  {self.sentence}"]
        lines += [f"  check: {finding}" for finding in self.findings]
        lines += [f"  {score_line(score)}" for score in self.scores if told(score)]
        lines += [f"  free run: {line}" for line in free_lines(self.free)]
        own = [one for one in self.after if any(one.name.startswith(_owner(name)) for name in self.named)]
        lines += [f"  {one.said}" for one in own]
        lines += [f"  declared: {one.said}" for one in self.drifted if one not in own]
        lines += [f"  left: {self.remainder.said}"] if self.remainder else []
        lines += [f"  next: {one.said}" for one in self.experiments]
        lines += [f"  written: {file}" for file in self.files]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; SI units, NaN and infinities as None."""
        rounds = self.search.rounds if self.search else ()
        return plain(
            {
                "kind": "drive-verdict",
                "name": self.name,
                "answer": self.answer.value,
                "sentence": self.sentence,
                "effects": [type(effect).__name__ for effect in self.effects],
                "named": list(self.named),
                "alike": list(self.alike),
                "explained": self.explained,
                "findings": [str(finding) for finding in self.findings],
                "held_out": [score._asdict() | {"said": score.said} for score in self.scores],
                "held_out_runs": [one._asdict() for one in self.runs],
                "free_runs": [one._asdict() for one in self.free],
                "before": {one.name: one._asdict() for one in self.before},
                "after": {one.name: one._asdict() for one in self.after},
                "profiles": [one._asdict() for one in self.profiles],
                "rounds": [_round(one) for one in rounds],
                "remainder": self.remainder.said if self.remainder else "",
                "experiments": [one.said for one in self.experiments],
                "files": [str(file) for file in self.files],
                **self.provenance,
            }
        )


def told(score: ChannelScore) -> bool:
    """Return whether a channel's change is worth a line: it can be claimed."""
    return score.worded.outcome in (Outcome.BETTER, Outcome.WORSE)


def free_lines(free: tuple[FreeRun, ...]) -> list[str]:
    """Return one line: how far free simulations stray from the log."""
    if not free:
        return []
    was, now = (
        float(np.sqrt(np.nanmean([row**2 for row in rows]))) for rows in zip(*[one[2:] for one in free], strict=True)
    )
    after = "" if was == now else f" -> {1e3 * now:.1f} mm"
    return [f"RMS distance from the logged place {1e3 * was:.1f} mm{after} over {len(free)} runs"]


def _owner(name: str) -> str:
    return name.partition("@")[0] + "."


def _round(one: Round) -> dict[str, Any]:
    return {
        "scored": [
            {"name": row.candidate.name, "gain": row.gain, "visible": row.visible, "absorbed": row.absorbed}
            for row in one.scored
        ],
        "refits": [_refit(each) for each in one.refits],
        "alike": [each.name for each in one.alike],
    }


def _refit(one: Refit) -> dict[str, Any]:
    own = (*one.candidate.sizes, *one.candidate.shapes)
    values = {name: one.fit.value(name) for name in own if name in {each.name for each in one.fit.parameters}}
    return {
        "name": one.name,
        "gain": one.gain,
        "fee": one.fee,
        "net": one.net,
        "held_out_gain": one.held_out,
        "misfit": one.fit.misfit,
        "values": values,
    }
