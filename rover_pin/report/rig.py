"""A loop's verdict as one HTML page that needs nothing else, with its figures as PNG files beside it."""

from __future__ import annotations

import inspect
from pathlib import Path

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Against, got_worse, interval, shown
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.left import RigExtra
from rover_pin.experiments.wheel_rig.residual_tests import BEYOND_CHANCE, ResidualTest
from rover_pin.report.page import HEADLINES, rendered, write_page
from rover_pin.report.profiles import profiles_figure
from rover_pin.report.rig_figures import (
    added_names,
    candidates_figure,
    channels_figure,
    refits_of,
    residuals_figure,
)

TEMPLATE = "rig.html"


def write_report(verdict: Verdict, data: RigSet, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    figures = {"channels": channels_figure(verdict, data), "residuals": residuals_figure(verdict, data)}
    if verdict.search and verdict.search.rounds[0].refits:
        figures["candidates"] = candidates_figure(verdict)
    if verdict.profiles:
        intervals = [(one.low, one.high) for one in (verdict.after.numbers if verdict.after else ())]
        figures["profiles"] = profiles_figure(verdict.profiles, intervals)
    return write_page(figures, lambda images: html(verdict, data, images), out)


def html(verdict: Verdict, data: RigSet, images: dict[str, str]) -> str:
    """Return the page."""
    return rendered(
        TEMPLATE,
        {
            "verdict": verdict,
            "data": data,
            "images": images,
            "headline": headline(verdict),
            "channels": channel_rows(verdict),
            "parameters": parameter_rows(verdict),
            "levels": level_rows(verdict),
            "tests": correlation_rows(verdict),
            "limit": BEYOND_CHANCE,
            "worse": got_worse((one.name, one.worded) for one in verdict.scores),
            "away": Against.AWAY,
            "cautions": verdict.cautions,
            "extra": verdict.extra,
            "refits": sorted(refits_of(verdict), key=lambda one: one.fit.misfit),
            "scored": verdict.search.rounds[0].scored if verdict.search else (),
            "fee": verdict.search.rounds[0].refits[0].fee
            if verdict.search and verdict.search.rounds[0].refits
            else 0.0,
            "names": added_names(verdict),
            "about": {type(effect).__name__: inspect.getdoc(type(effect)) for effect in verdict.effects},
        },
    )


def headline(verdict: Verdict) -> str:
    """Return the verdict in a line."""
    return HEADLINES[verdict.answer].format(names=added_names(verdict), alike=" / ".join(verdict.alike))


def channel_rows(verdict: Verdict) -> list[dict[str, str]]:
    """Return one row a channel: fitted and held-out RMSE before and after, the noise, what may be claimed."""
    rows = []
    extra = verdict.extra
    if not isinstance(extra, RigExtra):
        return []
    for score, was, now in zip(verdict.scores, extra.before.remainders, extra.after.remainders, strict=True):
        rows.append(
            {
                "name": score.name,
                "floor": shown(score.floor, score.unit),
                "fit_before": f"{was.rms:.2f}",
                "fit_after": f"{now.rms:.2f}",
                "before": shown(score.before, score.unit),
                "after": shown(score.after, score.unit),
                "times": f"{score.before / score.floor:.1f} to {score.after / score.floor:.1f}",
                "change": score.worded.text,
                "said": score.said,
            }
        )
    return rows


def level_rows(verdict: Verdict) -> list[list[str]]:
    """Return one row a held-out level: its name, then each channel's error before and after."""
    columns = [
        [f"{shown(one.before, score.unit)} to {shown(one.after, score.unit)}" for one in score.levels]
        for score in verdict.scores
    ]
    names = [one.level for one in verdict.scores[0].levels] if verdict.scores else []
    return [[name, *cells] for name, *cells in zip(names, *columns, strict=True)]


def parameter_rows(verdict: Verdict) -> list[dict[str, str]]:
    """Return one row a parameter: before and after with 95 % intervals."""
    before = {one.name: one for one in (verdict.before.numbers if verdict.before else ())}
    rows = []
    for one in verdict.after.numbers if verdict.after else ():
        was = before.get(one.name)
        rows.append(
            {
                "name": one.name,
                "before": interval(was.value, was.low, was.high, was.unit) if was else "not in the model",
                "after": interval(one.value, one.low, one.high, one.unit),
                "note": one.note,
                "prior": one.prior,
            }
        )
    return rows


def correlation_rows(verdict: Verdict) -> list[dict[str, str]]:
    """Return one row a residual test: correlation and p-value before and after."""
    extra = verdict.extra
    pairs = zip(extra.before.tests, extra.after.tests, strict=True) if isinstance(extra, RigExtra) else ()
    return [
        {"channel": was.channel, "against": was.against, "before": _test(was), "after": _test(now)}
        for was, now in pairs
    ]


def _test(test: ResidualTest) -> str:
    return f"{test.correlation:+.2f} (p = {test.p:.2g})" + (" *" if test.beyond_chance else "")
