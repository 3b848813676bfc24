"""A drive verdict as one HTML page that needs nothing else, with its figures as PNG files beside it."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import got_worse
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.drive_log.separating_drive import SeparatingDrive, unseparated
from rover_pin.experiments.unlisted.term import Term
from rover_pin.motion.drive_log import DriveLog
from rover_pin.report.drive_cautions import cautions, claims
from rover_pin.report.drive_figures import candidates_figure, heldout_figure, terms_figure
from rover_pin.report.drive_rows import (
    effect_rows,
    kinds_of,
    left_rows,
    number_rows,
    refits_of,
    run_rows,
    score_rows,
    summary_rows,
)
from rover_pin.report.drive_runs import Sides, free_figure, measured_figure, residuals_figure, words_of
from rover_pin.report.drive_sensitivity import sensitivities
from rover_pin.report.page import HEADLINES, rendered, write_page
from rover_pin.report.profiles import profiles_figure

TEMPLATE = "drive.html"
TERMS, RIVALS = 3, 2
"""Terms whose curves are drawn, and rivals of which it is said that no run tells them apart."""


def write_drive_report(verdict: Verdict, log: DriveLog, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    return write_page(figures(verdict), lambda images: html(verdict, log, images), out)


def sides_of(verdict: Verdict) -> Sides | None:
    """Return the fits before and after; the same where nothing was added, None where nothing could be fitted."""
    if verdict.search is None:
        return None
    added = verdict.named and verdict.answer is not Answer.NONE_FITS
    return Sides(verdict.search.base, verdict.search.last if added else verdict.search.base)


def figures(verdict: Verdict) -> dict[str, Figure]:
    """Return the figures by name: those for which the verdict has anything."""
    sides = sides_of(verdict)
    found: dict[str, Figure] = {}
    if sides is not None and verdict.search is not None:
        found |= {"residuals": residuals_figure(sides), "measured": measured_figure(sides)}
        if any(look.scored for look in verdict.search.rounds):
            found["candidates"] = candidates_figure(verdict.search)
        models = [sides.before.model, *([sides.after.model] if sides.added else [])]
        found["free"] = free_figure(sides.experiment, models)
    if verdict.scores:
        found["heldout"] = heldout_figure(verdict.scores, sides is not None and sides.added)
    left = extra_of(verdict).remainder
    if left is not None and not left.is_noise:
        found["terms"] = terms_figure(left.terms[:TERMS])
    if verdict.profiles:
        ends = {one.name: (one.low, one.high) for one in (verdict.after.numbers if verdict.after else ())}
        found["profiles"] = profiles_figure(verdict.profiles, [ends[one.name] for one in verdict.profiles])
    return found


def html(verdict: Verdict, log: DriveLog, images: dict[str, str]) -> str:
    """Return the page."""
    sides = sides_of(verdict)
    return rendered(
        TEMPLATE,
        {
            "verdict": verdict,
            "log": log,
            "images": images,
            "headline": headline(verdict),
            "added": sides is not None and sides.added,
            "seconds": sum(float(trace.t[-1] - trace.t[0]) for trace in log.runs if len(trace.t)),
            "claims": claims(verdict, sides),
            "cautions": cautions(verdict, sides),
            "summary": summary_rows(verdict, sides) if sides else [],
            "refits": list(refits_of(verdict.search)) if verdict.search else [],
            "scores": score_rows(verdict.scores, sides is not None and sides.added),
            "worse": got_worse((words_of(one.name), one.worded) for one in verdict.scores),
            "runs": run_rows(verdict.runs, sides is not None and sides.added),
            "numbers": number_rows(verdict, sides) if sides else [],
            "next": experiments(verdict),
            "unfitted": verdict.answer is Answer.NONE_FITS,
            "physics": [
                (kind.__name__, paragraphs(inspect.getdoc(kind) or ""), effect_rows(verdict, kind))
                for kind in kinds_of(verdict)
            ],
            **_limits(verdict),
            **_left(verdict),
        },
    )


def headline(verdict: Verdict) -> str:
    """Return the verdict in a line."""
    names = " + ".join(verdict.named)
    return HEADLINES[verdict.answer].format(names=names, alike=" / ".join(verdict.alike))


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a docstring."""
    return [part for part in text.split("\n\n") if part.strip()]


def experiments(verdict: Verdict) -> list[str]:
    """Return what to drive next, and which rivals no run of the menu tells from the best."""
    lines = [one.said for one in verdict.experiments]
    told = {one.second for one in verdict.experiments if isinstance(one, SeparatingDrive)}
    for rival in verdict.alike[1 : 1 + RIVALS]:
        lines += [] if rival in told else [unseparated(verdict.alike[0], rival)]
    return lines


def _limits(verdict: Verdict) -> dict[str, Any]:
    """Return what the log cannot tell, and the smallest sizes of what it can."""
    found = sensitivities(verdict.search) if verdict.search else ()
    return {
        "untold": [one for one in found if not one.told],
        "told": [one for one in found if one.told],
    }


def _left(verdict: Verdict) -> dict[str, Any]:
    """Return what the model leaves: sentences, the best terms, and channels with what they go with."""
    left = extra_of(verdict).remainder
    if left is None:
        return {"left": "", "left_channels": [], "signals": [], "terms": []}

    def row(one: Term) -> tuple[str, ...]:
        held = "" if one.held_out is None else f"{one.held_out:+.1f}"
        return (f"it {one.said}", f"{one.gain:.1f}", f"{one.fee:.1f}", held, f"{one.strength:+.1f}")

    return {
        "left": left.said,
        "left_channels": left_rows(left),
        "signals": list(left.channels[0].correlations) if left.channels else [],
        "terms": [row(one) for one in left.terms[:TERMS]],
    }
