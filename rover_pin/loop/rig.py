"""The loop: measured rig data against a model, the effect that it lacks, the model with it, before and after."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.columns import replace_file
from rover_pin.contact import Soil
from rover_pin.discrepancy.answer import TAKES_MOST, Answer
from rover_pin.experiments.wheel_rig.calibrate import (
    Setting,
    calibrate,
    flags,
    nuisances,
    parameters,
    remains,
    settled,
)
from rover_pin.experiments.wheel_rig.candidates import rig_kinds
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, too_poor
from rover_pin.experiments.wheel_rig.compare import Candidate, Comparison, compare_pairs, compare_singles
from rover_pin.experiments.wheel_rig.data import RigSet, as_rig_set, read_rig_set
from rover_pin.experiments.wheel_rig.fit import RigFit
from rover_pin.experiments.wheel_rig.held_out import held_out, scores
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel
from rover_pin.experiments.wheel_rig.model_file import write_model
from rover_pin.experiments.wheel_rig.profile_curve import profiles
from rover_pin.experiments.wheel_rig.remainder import draft_effect, remainders
from rover_pin.experiments.wheel_rig.reselect import NOTHING, reselect
from rover_pin.experiments.wheel_rig.residual_tests import residual_tests
from rover_pin.experiments.wheel_rig.screen import screen
from rover_pin.experiments.wheel_rig.separating_run import separating_run
from rover_pin.experiments.wheel_rig.verdict import Side, Verdict
from rover_pin.loop.provenance import command, provenance
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.report.rig import write_report
from rover_pin.report.rig_cautions import of_choice, of_parameters, of_residuals

ENOUGH = 0.9
"""Least share of chi2 beyond the noise that an effect must take to be named rather than mentioned."""

LEFT = 0.01
"""What is left with less than this probability, beside too small a share, keeps an effect from being named."""

RIVALS = 3
"""Rivals of the best for which a separating run is proposed."""

Progress = Callable[[str], None]


def close_rig_loop(
    data: str | Path | WheelRig | RigSet,
    model: RigModel | Soil | None = None,
    effects: str | Path | None = None,
    out: str | Path | None = None,
    progress: Progress = lambda said: None,
    seed: int = 0,
) -> Verdict:
    """Find the effect that a model lacks against a wheel-rig set, add it, and report the error before and after.

    Parameters
    ----------
    data : path, WheelRig or RigSet
        A folder with rig.toml, or a set in memory.
    model : RigModel, Soil or None
        Where to start; the paper's traction on this soil, or on the soil as the data declare it.
    effects : path or None
        A user's effect file or folder, beside the package's own.
    out : path or None
        Folder for report.html, verdict.json, model.toml and figures; nothing is written without, and what takes many
        refits is left out: profiles, and the choice made anew without each level.
    progress : callable
        Called with one line before each step.
    seed : int
        Of the starts of fits and of the bootstrap.

    Returns
    -------
    Verdict
        With `summary()`, `model` (the base model with what was added, if anything) and `as_dict()`.

    Raises
    ------
    DataError
        Data that cannot be read or cannot answer: one sentence each.
    OptimisationError
        The base model cannot be fitted at all.
    """
    begun = time.monotonic()
    rig_set = _rig_set(data)
    refuse_unfit(rig_set)
    start = _start(rig_set, model)
    free, priors = nuisances(rig_set, start)
    setting = Setting(rig_set, free, priors, seed)
    progress("calibrating the base model")
    base = calibrate(setting, start)
    verdict = decide(setting, base, effects, progress)
    verdict.provenance.update(provenance(seed, time.monotonic() - begun, command(data, effects, out)))
    return verdict if out is None else _written(verdict, setting, Path(out), progress)


def _rig_set(data: str | Path | WheelRig | RigSet) -> RigSet:
    if isinstance(data, RigSet):
        return data
    if isinstance(data, WheelRig):
        return as_rig_set(data)
    return read_rig_set(data)


def _start(data: RigSet, model: RigModel | Soil | None) -> RigModel:
    if isinstance(model, RigModel):
        return model
    soil = model if isinstance(model, Soil) else data.soil()
    return RigModel(data.rig.wheel, soil, ASKEW if data.rig.askew.any() else PAPER)


def decide(setting: Setting, base: RigFit, effects: str | Path | None, progress: Progress) -> Verdict:
    """Return the verdict: too poor, or screened, refitted, paired where one is not enough, and judged."""
    poor = too_poor(setting.data, len(setting.free))
    if poor:
        return _verdict(setting, base, None, (Comparison(), Comparison()), (), poor)
    progress("score test of every candidate")
    kinds = rig_kinds(effects)
    screened = screen(setting, base, kinds)
    singles = compare_singles(setting, base, screened, progress)
    pairs, chosen = Comparison(), singles
    if singles.best or remains(base):
        further = screen(setting, singles.best.fit, kinds) if singles.best else screened
        pairs = compare_pairs(setting, base, singles, further, progress)
        chosen = pairs if pairs.best else singles
    progress("intervals and held-out levels")
    return _verdict(setting, base, chosen, (singles, pairs), tuple(screened), "")


def _verdict(
    setting: Setting,
    base: RigFit,
    chosen: Comparison | None,
    compared: tuple[Comparison, Comparison],
    screened: tuple[Any, ...],
    poor: str,
) -> Verdict:
    data, best = setting.data, chosen.best if chosen else None
    explained = share_taken(base, best)
    answer = answer_of(base, chosen, explained, bool(poor), compared[0].best)
    if answer is Answer.LIKE:
        best, explained = compared[0].best, held_out_share(compared[0].best)
    left = remains(best.fit if best else base)
    if answer is Answer.NONE_FITS:
        best = None  # the nearest is mentioned, not added
    fit, before = _side(setting, settled(base))
    last, after = (fit, before) if best is None else _side(setting, settled(best.fit))
    alike = compared[0].alike if answer is Answer.LIKE else chosen.alike if chosen else ()
    runs = [separating_run(data, alike[0], rival) for rival in alike[1 : 1 + RIVALS]] if best else []
    added = () if best is None else after.model.effects[len(base.model.effects) :]
    was = held_out(data, fit) if not poor else fit.residual
    now = held_out(data, last) if best is not None else was
    said = of_parameters(after.parameters, after.flags) + of_residuals(after.remainders, after.tests)
    verdict = Verdict(
        answer=answer,
        name=data.rig.name,
        sentence=poor or _sentence(answer, alike, explained, left),
        model=after.model,
        effects=added,
        alike=tuple(one.name for one in alike),
        before=before,
        after=after,
        scores=scores(data, was, now, setting.seed) if not poor else (),
        screened=screened,
        singles=compared[0],
        pairs=compared[1],
        explained=explained,
        findings=tuple(findings(data)),
        experiments=tuple(one for one in runs if one is not None),
        provenance={},
        cautions=tuple(said),
        base=base,
    )
    return vetoed(verdict, at_bounds(verdict))


def at_bounds(verdict: Verdict) -> tuple[str, ...]:
    """Return which numbers of what was added lie at a bound: its law is strained to do what it does.

    A bound at which the law is as published, its default, strains nothing.
    """
    usual = {f"{type(one).__name__}.{name}": x for one in verdict.effects for name, x in type(one)().values().items()}
    own = [one for one in verdict.after.parameters if one.at_bound and one.name in usual]
    return tuple(f"{one.name} lies at its bound" for one in own if not math.isclose(one.value, float(usual[one.name])))


def vetoed(verdict: Verdict, against: tuple[str, ...]) -> Verdict:
    """Return the verdict with what speaks against a lone name, which then does not stand alone."""
    if verdict.answer is not Answer.NAMED or not against:
        return verdict
    said = f"{verdict.sentence} But the name does not stand alone: {'; '.join(against)}."
    return dataclasses.replace(verdict, answer=Answer.LIKE, sentence=said, vetoes=(*verdict.vetoes, *against))


def _side(setting: Setting, fit: RigFit) -> tuple[RigFit, Side]:
    data, (fit, fitted) = setting.data, parameters(fit)
    tests = residual_tests(data, fit.residual, setting.seed)
    return fit, Side(fit.model, fitted, flags(data, fit, fitted), remainders(data, fit), fit.misfit, fit, tests)


def share_taken(base: RigFit, best: Candidate | None) -> float:
    """Return the share of the base's chi2 beyond the noise that the best candidate takes."""
    if best is None:
        return 0.0
    beyond = base.chi2 - max(base.problem.freedom, 1)
    return float(np.clip((base.chi2 - best.fit.chi2) / beyond, 0, 1)) if beyond > 0 else 1.0


def held_out_share(one: Candidate | None) -> float:
    """Return the share of the held-out loss beyond the noise, 1, that a candidate takes."""
    if one is None or not one.reference_loss > 1.0:
        return 0.0
    return float(np.clip((one.reference_loss - one.loss) / (one.reference_loss - 1.0), 0.0, 1.0))


def answer_of(
    base: RigFit, chosen: Comparison | None, explained: float, poor: bool, single: Candidate | None = None
) -> Answer:
    """Return what may be said of the model, given the candidates that were compared and the share taken.

    Where more than the noise is left, what is missing is like the best `single` effect if that takes most of what is
    missed on levels held out. A pair is not asked: two laws together imitate much.
    """
    if poor or chosen is None:
        return Answer.CANNOT_TELL
    if chosen.best is None:
        return Answer.NONE_FITS if remains(base) else Answer.NONE_NEEDED
    if remains(chosen.best.fit, LEFT) and explained < ENOUGH:
        return Answer.LIKE if held_out_share(single) >= TAKES_MOST else Answer.NONE_FITS
    return Answer.NAMED if len(chosen.alike) == 1 else Answer.SET


def _sentence(answer: Answer, alike: tuple[Candidate, ...], explained: float, left: bool) -> str:
    names = " or ".join(one.name for one in alike)
    rest = " What is left is still more than the noise: see the remainder." if left else ""
    share = f"{explained:.0%} of what the base model misses beyond the noise"
    if answer is Answer.NAMED:
        return f"the data are consistent with {names}, which takes {share}.{rest}"
    if answer is Answer.SET:
        return f"the data do not tell {names} apart; the first takes {share}.{rest}"
    if answer is Answer.LIKE:
        return (
            f"something like {names} is missing: the first takes {explained:.0%} of what the base model misses on "
            f"levels held out, but its law does not hold exactly.{rest}"
        )
    if answer is Answer.NONE_NEEDED:
        return "the calibrated base model meets the data within their noise, and no candidate gains more than chance."
    near = f" The nearest, {alike[0].name}, takes {share}." if alike else ""
    return f"the base model misses the data by more than their noise, and no candidate explains it.{near}"


def _confirmed(verdict: Verdict, setting: Setting) -> Verdict:
    """Return the verdict with what takes many refits: the choice made anew without each level, and profiles."""
    verdict = dataclasses.replace(verdict, profiles=profiles(verdict.after.fit, verdict.after.parameters))
    if verdict.answer is Answer.CANNOT_TELL:
        return verdict
    again = reselect(setting.data, verdict.base, verdict.singles, verdict.pairs)
    was = held_out(setting.data, verdict.before.fit)
    name = " + ".join(type(effect).__name__ for effect in verdict.effects) or NOTHING
    verdict = dataclasses.replace(
        verdict,
        folds=again.folds,
        reselected=scores(setting.data, was, again.residual, setting.seed),
        cautions=(*verdict.cautions, *of_choice(name, again, verdict.singles)),
    )
    times, levels = again.times(name), len(again.folds)
    return vetoed(verdict, (f"it is chosen in {times} of {levels} folds",) if 2 * times <= levels else ())


def _written(verdict: Verdict, setting: Setting, out: Path, progress: Progress) -> Verdict:
    """Write the files and return the verdict with their paths."""
    progress("choosing again without each level")
    verdict = _confirmed(verdict, setting)
    progress("writing the report")
    files = [write_model(verdict.model, out / "model.toml", verdict.sentence)]
    if verdict.answer in (Answer.NONE_FITS, Answer.LIKE) and any(not one.is_noise for one in verdict.after.remainders):
        text = draft_effect(setting.data, verdict.after.remainders)
        files.append(replace_file(out / "draft_effect" / "measured_remainder.py", text))
    files += write_report(verdict, setting.data, out)
    files.append(out / "verdict.json")
    verdict = dataclasses.replace(verdict, files=tuple(files))
    replace_file(out / "verdict.json", json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict
