"""Find gains: a global search, a polish of its best on the full rover, whose verdict decides.

The landscape of the gains has several minima and cliffs, so that differential evolution looks everywhere first: on the
reduced model where its slip is that of the full rover (`trust`), on the full rover elsewhere, and wherever sensors are
read or S_d falls with the hole. Nelder-Mead then goes down from the best points, on the full rover alone, by the very
score that decides: fewest burials first. It takes no derivatives: over 40 s in a ditch two drives part so fast that
those of a drive say nothing of gains 1 % away (tests/tuning/test_polish.py).
"""

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution, minimize
from scipy.stats import qmc

from rover_pin.base.errors import OptimisationError
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.jobs.cluster import refuse_both, workers_of
from rover_pin.base.jobs.workers import ending_workers
from rover_pin.tuning.drive_score import Score
from rover_pin.tuning.drives import CHECKED, CONSTANT, Control, build, cautions, full_score, reduced_score, seal
from rover_pin.tuning.evaluations import Evaluations, Progress
from rover_pin.tuning.report import Candidate, Drives, Trial, TuningResult, write_result
from rover_pin.tuning.study import LOGARITHMIC, Run, SlipLaw, TuningStudy
from rover_pin.tuning.trust import Checked, check_drives, checked_over, refusal

APART = 0.1
"""Points closer than this in every coordinate of the unit cube count as one."""


class Point(NamedTuple):
    """A point of the unit cube with its cost in the search."""

    place: np.ndarray
    cost: float
    stage: str
    trial: Trial | None = None
    before: float = math.nan
    "the cost on the full rover where a polish began"


def tune_gains(
    study: TuningStudy,
    out: str | Path | None = None,
    progress: Progress | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> TuningResult:
    """Return the best gains found for a study, and what they are worth beside the gains before and constant duty.

    Parameters
    ----------
    out : path, optional
        Folder for gains.toml, the tables and the finished evaluations; a killed tuning resumes there.
    progress : callable, optional
        Called with the stage, its finished evaluations and their number.
    workers : int, optional
        Processes; by default one a core. The result does not depend on it.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers then do the work. Start them with `--nthreads 1`.

    Raises
    ------
    ParameterError
        A drive with an unknown scenario or setting, or one that its model file rules out; a scheduler that does not
        answer, or with `workers` given too.
    OptimisationError
        Every training drive ends stuck whatever the gains; `status` holds constant duty's scores.
    DataError
        The folder or a model file cannot be used, another process is at work in the folder, or the model was changed
        meanwhile.
    """
    refuse_both(workers, scheduler)
    study = seal(study)
    for case in (*study.training, *study.held_out):
        build(case)
    with alone_in(out), ending_workers(), workers_of(workers or -1, scheduler) as work:
        evaluations = Evaluations(None if out is None else Path(out), work, progress)
        try:
            result = _tune_law(study, evaluations)
        except (KeyboardInterrupt, SystemExit) as stop:
            stop.add_note(evaluations.resume_hint())
            raise
        return result if out is None else write_result(result, Path(out))


def _tune_law(study: TuningStudy, evaluations: Evaluations) -> TuningResult:
    begin = time.perf_counter()
    checks = checked_over(study, evaluations)
    points = search(study, evaluations, checks)
    polished = [polish(study, evaluations, start) for start in spread_points(points, study.effort.starts)]
    candidates = evaluate_points(study, evaluations, [*spread_points(points, study.effort.keep), *polished])
    constant = _constant(study, evaluations)
    if all(score.stuck for candidate in candidates for score in candidate.scores):
        raise OptimisationError(
            f"Tuning '{study.name}': every training drive ends stuck whatever the gains "
            f"({len(candidates)} sets driven by the full rover); constant duty {study.before.delta_0:g} costs "
            f"{study.cost.mean(np.array(constant)):.3f} with {_count_stuck(constant)} of {len(constant)} stuck: choose "
            "gentler drives, or do without this control.",
            status=constant,
        )
    best = min(candidates, key=lambda candidate: float(study.cost.choice(np.array(candidate.scores))))
    return TuningResult(
        study,
        best.law,
        candidates,
        tuple(_report(study, evaluations, best.law)),
        tuple((check.case.name, *check[1:]) for check in check_drives(study, evaluations, best.law)),
        evaluations.fresh,
        time.perf_counter() - begin,
        cautions=cautions((*study.training, *study.held_out)),
        search_notes=(*_on_full(study, checks), *_polish_notes(polished)),
        trials=tuple(point.trial for point in points if point.trial),
    )


def search(study: TuningStudy, evaluations: Evaluations, checks: Sequence[Checked]) -> list[Point]:
    """Return every point that differential evolution tries, the gains before among the first."""
    effort, size = study.effort, len(study.free)
    tried: list[Point] = []

    def costs(places: np.ndarray) -> np.ndarray:
        scores = search_scores(study, evaluations, [study.law(place) for place in places.T], checks)
        choices = np.asarray(study.cost.choice(scores))
        for place, choice, drives in zip(places.T, choices, scores, strict=True):
            tried.append(Point(place.copy(), float(choice), "search", Trial.of(drives)))
        return choices

    first = qmc.LatinHypercube(size, seed=study.seed).random(effort.population)
    first[0] = place_of(study, study.law_before)
    differential_evolution(
        costs,
        [(0.0, 1.0)] * size,
        init=first,
        maxiter=effort.generations,
        tol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        seed=study.seed,
    )
    return tried


def search_scores(
    study: TuningStudy, evaluations: Evaluations, laws: Sequence[SlipLaw], checks: Sequence[Checked]
) -> np.ndarray:
    """Return the scores (laws, drives, parts): of the reduced model where it is trusted, else of the rover."""
    runs, trusted = study.training_runs, {check.case.name for check in checks if check.trusted}
    scores = np.zeros((len(laws), len(runs), len(Score._fields)))
    for is_reduced, stage, score in (
        (True, "search on the reduced model", reduced_score),
        (False, "search on the full rover", full_score),
    ):
        places = [i for i, run in enumerate(runs) if (run.case.name in trusted) == is_reduced]
        jobs = [job_of(study, law, runs[i]) for law in laws for i in places]
        if jobs:
            scores[:, places] = np.reshape(evaluations.run(stage, score, jobs), (len(laws), len(places), -1))
    return scores


def job_of(study: TuningStudy, law: SlipLaw, run: Run) -> tuple[Any, ...]:
    """Return the arguments of a drive's score."""
    return run.case, Control.of(study.estimate, law, run.seed)


def _on_full(study: TuningStudy, checks: Sequence[Checked]) -> tuple[str, ...]:
    """Return in words where the search drives the full rover."""
    if not study.has_reduced_model:
        return ("the search drives the full rover: its sensors and holes are not in the reduced model",)
    off = [check for check in checks if not check.trusted]
    if not off:
        return ()
    drives = f"{len(off)} of {len(checks)} drives"
    return (f"the search drives the full rover on {drives}: {refusal(off)}",)


def _polish_notes(polished: Sequence[Point]) -> tuple[str, ...]:
    """Return in words what each polish made of its start."""
    costs = [f"{point.before:.4f} to {point.cost:.4f}" for point in polished]
    return (
        (f"the polish on the full rover brought the cost of the best starts from {', '.join(costs)}",) if costs else ()
    )


def reduced_costs(study: TuningStudy, evaluations: Evaluations, laws: Sequence[SlipLaw]) -> np.ndarray:
    """Return the ensemble's cost of each law on the reduced model, unsmoothed but for stuck and buried."""
    everywhere = [Checked(case, 0.0, 0.0, 0.0) for case in study.training]
    return study.cost.mean(search_scores(study, evaluations, laws, everywhere))


def polish(study: TuningStudy, evaluations: Evaluations, start: Point) -> Point:
    """Return where Nelder-Mead comes to from a point, no worse on the full rover than that; `before` says how much."""
    size, costs = len(start.place), []

    def cost(place: np.ndarray) -> float:
        jobs = [job_of(study, study.law(place), run) for run in study.training_runs]
        costs.append(float(study.cost.choice(np.array(evaluations.run("polish on the full rover", full_score, jobs)))))
        return costs[-1]

    inward = np.where(start.place > 0.5, -APART, APART)
    options = {"initial_simplex": np.vstack([start.place, start.place + np.diag(inward)]), "maxfev": study.effort.steps}
    result = minimize(cost, start.place, method="Nelder-Mead", bounds=[(0.0, 1.0)] * size, options=options)
    return Point(np.clip(result.x, 0.0, 1.0), float(result.fun), "polish", before=costs[0])


def spread_points(points: Sequence[Point], most: int) -> list[Point]:
    """Return the best points that lie apart from each other, the best first."""
    selected: list[Point] = []
    for point in sorted(points, key=lambda candidate: candidate.cost):
        if len(selected) < most and all(np.max(np.abs(point.place - earlier.place)) > APART for earlier in selected):
            selected.append(point)
    return selected


def evaluate_points(study: TuningStudy, evaluations: Evaluations, points: Sequence[Point]) -> tuple[Candidate, ...]:
    """Return the numbers before and those of the points, each with the full rover's scores on the training drives."""
    sets = [("before", study.law_before), *((point.stage, study.law(point.place)) for point in points)]
    laws = [law for _, law in sets]
    reduced = reduced_costs(study, evaluations, laws) if study.has_reduced_model else np.full(len(laws), math.nan)
    jobs = [job_of(study, law, run) for law in laws for run in study.training_runs]
    flat_scores = evaluations.run("verdict of the full rover", full_score, jobs)
    scores = np.reshape(flat_scores, (len(laws), -1, len(Score._fields)))
    rows = zip(sets, reduced, study.cost.mean(scores), scores.tolist(), strict=True)
    return tuple(
        Candidate(stage, law, float(reduced_cost), float(cost), tuple(Score(*score) for score in drives))
        for (stage, law), reduced_cost, cost, drives in rows
    )


def place_of(study: TuningStudy, law: SlipLaw) -> np.ndarray:
    """Return the point of the unit cube where the free numbers are these, at the nearest bound where outside."""
    place = []
    for name, (low, high) in study.free.items():
        value = min(max(law.number(name), low), high)
        place.append(
            math.log(value / low) / math.log(high / low) if name in LOGARITHMIC else (value - low) / (high - low)
        )
    return np.array(place)


def _report(study: TuningStudy, evaluations: Evaluations, law: SlipLaw) -> list[Drives]:
    """Return all drives without control, under the torque check alone, and by each estimate before and after."""
    laws = {"constant duty": (CONSTANT, study.law_before), "torque check": (CHECKED, study.law_before)}
    for estimate in study.compared:
        laws[f"before, {estimate}"] = (estimate, study.law_before)
        laws[f"tuned, {estimate}"] = (estimate, law)
    runs = (*study.training_runs, *study.held_out_runs)
    jobs = [(run.case, Control.of(by, numbers, run.seed)) for by, numbers in laws.values() for run in runs]
    scores = [Score(*score) for score in evaluations.run("report on all drives", full_score, jobs)]
    rows = [tuple(scores[i * len(runs) : (i + 1) * len(runs)]) for i in range(len(laws))]
    split = len(study.training_runs)
    return [Drives(name, row[:split], row[split:]) for name, row in zip(laws, rows, strict=True)]


def _constant(study: TuningStudy, evaluations: Evaluations) -> tuple[Score, ...]:
    jobs = [(case, Control.of(CONSTANT, study.law_before)) for case in study.training]
    return tuple(Score(*score) for score in evaluations.run("constant duty", full_score, jobs))


def _count_stuck(scores: Sequence[Score]) -> int:
    return int(sum(score.stuck for score in scores))
