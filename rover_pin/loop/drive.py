"""The loop on drive logs: checked, calibrated, searched, judged on runs left out, and written down."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from rover_pin.cluster import Workers
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.compare import Refit
from rover_pin.discrepancy.conclusion import numbers
from rover_pin.discrepancy.held_out import held_out
from rover_pin.discrepancy.profiles import profiles
from rover_pin.discrepancy.search import Search, search
from rover_pin.estimation.wording import shown
from rover_pin.experiments.drive_log.calibrate import calibrated_on
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.checks.log import findings, refuse_unfit, too_poor
from rover_pin.experiments.drive_log.experiment import logged
from rover_pin.experiments.drive_log.free_runs import free_runs
from rover_pin.experiments.drive_log.model import base_model, held, with_spread
from rover_pin.experiments.drive_log.resume import Memory, key_of_code
from rover_pin.experiments.drive_log.separating_drive import SeparatingDrive, separating_drive
from rover_pin.experiments.drive_log.verdict import DriveVerdict
from rover_pin.experiments.unlisted.remainder import Remainder, describe
from rover_pin.loop.drive_written import written
from rover_pin.loop.provenance import command, provenance
from rover_pin.motion.drive_log import DriveLog
from rover_pin.motion.effect_files import file_of, user_effects
from rover_pin.motion.model import Model

RIVALS = 2
"""Rivals of the best for which a separating run is proposed."""
UNKNOWN = 90.0
"""Strength of a term, after everything listed, from which something that is not on the list is said to act: on null
sets raked sand showed up to 68 (seed 902)."""
MUCH = 0.1
"""Share of the net gain of what was added from which such a term makes it doubtful: after false names it was 0.15 to
0.3, after true ones no term came near UNKNOWN (seed 1303, once that had been scored)."""

Progress = Callable[[str], None]


def close_drive_loop(
    log: DriveLog,
    model: Model | None = None,
    effects: str | Path | None = None,
    out: str | Path | None = None,
    progress: Progress = lambda said: None,
    seed: int = 0,
    jobs: Workers = 1,
) -> DriveVerdict:
    """Return what a model of a drive log lacks, with the error before and after; see `close_the_loop`.

    Raises
    ------
    DataError
        A log that cannot be used: one sentence each.
    """
    begun = time.monotonic()
    progress("checking the log")
    refuse_unfit(log)
    poor, start = too_poor(log), model or base_model(log)
    folder = None if out is None else Path(out)
    memory = Memory(folder, "" if folder is None else key_of_code(_code(start, effects)))
    with memory.noting():
        verdict = _poor(log, start, poor) if poor else _decided(log, start, effects, memory, (progress, jobs, seed))
        verdict.provenance.update(provenance(seed, time.monotonic() - begun, command(log.folder, effects, out)))
        if folder is None:
            return verdict
        progress("writing the report")
        verdict = written(verdict, log, folder)
    memory.done()
    return verdict


def _decided(
    log: DriveLog, start: Model, effects: str | Path | None, memory: Memory, how: tuple[Progress, Workers, int]
) -> DriveVerdict:
    progress, jobs, seed = how
    if memory.told:
        progress(f"going on: {memory.told}")
    base = calibrated_on(log, with_spread(start, motors=not held(log)), jobs, progress, memory)
    found = search(base, candidates(base.model, logged(base), base.parameters, effects), progress)
    progress("describing what is left")
    return verdict_on(log, found, describe(found.last, progress), seed, progress)


def _code(model: Model, effects: str | Path | None) -> set[Path]:
    """Return the files with the code of effects: a user's own, and those of the model."""
    own = user_effects(effects) if effects else ()
    return {file_of(kind) for kind in (*own, *map(type, model.all_effects))}


def _poor(log: DriveLog, model: Model, poor: str) -> DriveVerdict:
    return DriveVerdict(
        Answer.CANNOT_TELL, log.about.name, poor, model, (), (), 0.0, (), (), (), (), None, findings(log), (), None, {}
    )


def verdict_on(log: DriveLog, found: Search, left: Remainder, seed: int, progress: Progress) -> DriveVerdict:
    """Return the verdict on what was found in a log and what is left; what is doubtful is not in its model."""
    best = found.rounds[0].alike
    answer = answer_of(found, left)
    progress("runs left out, and driven freely")
    last = found.last if answer is not Answer.NONE_FITS else found.base
    named = tuple(one.name for one in found.found) if answer is not Answer.NONE_FITS else ()
    sizes = tuple(name for one in found.found if named for name in one.candidate.sizes)
    held = held_out(found.base, last, seed)
    return DriveVerdict(
        answer=answer,
        name=log.about.name,
        sentence=_sentence(answer, found, left),
        model=last.model,
        alike=tuple(one.name for one in best),
        named=named,
        explained=explained(found),
        before=numbers(found.base),
        after=numbers(last),
        scores=held.channels,
        free=free_runs(logged(found.base), found.base.model, last.model),
        remainder=left,
        findings=findings(log),
        experiments=_experiments(best, progress),
        search=found,
        provenance={},
        runs=held.runs,
        profiles=profiles(last, sizes) if sizes else (),
    )


def explained(found: Search) -> float:
    """Return the share of the base's chi2 beyond the noise that what was added takes."""
    beyond = found.base.chi2 - found.base.task.noise.count
    return (
        float(np.clip((found.base.chi2 - found.last.chi2) / beyond, 0, 1)) if beyond > 0 else float(bool(found.found))
    )


def is_unknown(found: Search, left: Remainder) -> bool:
    """Return whether a term takes, after everything listed, more than chance and no less than what was added.

    Where sand that was prepared anew is what describes it best, nothing is missing: the model's sand is everywhere one.
    """
    taken = sum(one.net for one in found.found)
    return left.best.strength > max(UNKNOWN, MUCH * taken) and not left.best.is_raking


def answer_of(found: Search, left: Remainder) -> Answer:
    """Return what may be said of the model, given what was found and what is left."""
    if is_unknown(found, left):
        return Answer.NONE_FITS
    if not found.found:
        return Answer.NONE_NEEDED
    return Answer.NAMED if all(len(each.alike) == 1 for each in found.rounds if each.alike) else Answer.SET


def _sentence(answer: Answer, found: Search, left: Remainder) -> str:
    wheels = [wheel.name for wheel in found.base.model.rover.wheels]
    names = " and ".join(spoken(one.name, wheels) for one in found.found)
    alike = " or ".join(spoken(one.name, wheels) for one in found.rounds[0].alike)
    share = f"{explained(found):.0%} of what the base model misses beyond the noise{_bent(found)}"
    if answer is Answer.NAMED:
        return f"the log is consistent with {names}, which takes {share}."
    if answer is Answer.SET:
        return f"the log does not tell {alike} apart; {names} takes {share}."
    if answer is Answer.NONE_NEEDED:
        return "the calibrated base model meets the log within its noise, and no candidate gains more than chance."
    near = f" The nearest of the list, {found.found[0].name}, does not take it." if found.found else ""
    return f"something acts that is not on the list: it {left.best.said}.{near}"


def spoken(name: str, wheels: Sequence[str]) -> str:
    """Return a candidate's name with its wheel's, where it has a wheel's number only."""
    number = name.partition("[")[2].rstrip("]")
    return f"{name} (wheel {wheels[int(number)]})" if number.isdigit() else name


def _bent(found: Search) -> str:
    """Return how far the base model already had to bend the numbers that were freed, if any."""
    freed = {size for one in found.found if one.candidate.effect is None for size in one.candidate.sizes}
    bent = [one for one in numbers(found.base) if one.name in freed]
    told = [f"{one.name} to {shown(one.value, one.unit)}, {one.drift:+.0f} SD from what is declared" for one in bent]
    return f"; the base model already had to bend {' and '.join(told)}, so its errors are small too" if told else ""


def _experiments(best: tuple[Refit, ...], progress: Progress) -> tuple[SeparatingDrive, ...]:
    found = []
    for rival in best[1 : 1 + RIVALS]:
        progress(f"looking for the run that tells {best[0].name} from {rival.name}")
        one = separating_drive((best[0].name, best[0].fit), (rival.name, rival.fit), progress)
        found += [one] if one is not None else []
    return tuple(found)
