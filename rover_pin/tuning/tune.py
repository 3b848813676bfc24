"""The search for gains: differential evolution, then a polish (a descent) from the best points; drives of the full
rover (the complete simulation) decide which gains are best.

The cost as a function of the gains has several minima and cliffs, so that differential evolution searches the whole
range first. It uses the reduced model for drives on which the slip of this model agrees with the slip of the full rover
(`trust`). It uses the full rover for all other drives, and always if the control reads sensors or has a hole law. The
method of Nelder and Mead then descends from the best points on the full rover, with the cost that decides in the end
and that prefers fewer burials.

The method of Nelder and Mead needs no derivatives. Derivatives of a drive would not help, because within 40 s in a
ditch two drives diverge so fast that the derivative is useless for gains that differ by 1 %
(tests/tuning/test_polish.py).
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
from rover_pin.base.public import public
from rover_pin.tuning.drive_score import Score
from rover_pin.tuning.drives import (
    CONSTANT_DUTY,
    TORQUE_CHECK,
    Control,
    build,
    cautions,
    full_score,
    reduced_score,
    seal,
)
from rover_pin.tuning.evaluations import Evaluations, Progress
from rover_pin.tuning.report import Candidate, ControlScores, Trial, TuningResult, write_result
from rover_pin.tuning.study import LOGARITHMIC, SeededDrive, SlipLaw, TuningStudy
from rover_pin.tuning.study_file import read_tuning
from rover_pin.tuning.trust import ReducedModelCheck, check_drives, refusal, worse_checks

MIN_DISTANCE = 0.1
"""Minimum difference between two points of the unit cube that are both kept. At least one coordinate must differ by
this much. The initial simplex of a polish has this size too."""


class SearchPoint(NamedTuple):
    """A set of gains as a point of the unit cube, with its cost in the search. The search varies the free numbers
    within this cube.
    """

    place: np.ndarray
    "a coordinate from 0 to 1 for each free number (numbers,)"
    cost: float
    """cost of the training drives, for the comparison of points"""
    stage: str
    "origin of the point: search, or polish (the descent after the search)"
    trial: Trial | None = None
    "fractions of the training drives that get through and that bury a wheel"
    before: float = math.nan
    "cost on the full rover at the start of a polish"


@public
def tune_gains(
    study: TuningStudy | str | Path,
    out: str | Path | None = None,
    progress: Progress | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> TuningResult:
    """Find the best gains for a study, and compare them with the gains before the tuning and with constant duty.

    Parameters
    ----------
    study : TuningStudy or path
        Free gains, drives and number of evaluations: a study's TOML file, or a study that was made in Python.
    out : path, optional
        Folder for gains.toml, tables, figures and finished evaluations. A tuning that was stopped continues from this
        folder.
    progress : callable, optional
        Called with the name of a stage, the number of its finished evaluations, and their total.
    workers : int, optional
        Number of processes; by default one per core. The result does not depend on this number.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run the drives instead of local processes. Start the workers with
        `--nthreads 1`.

    Returns
    -------
    TuningResult
        The best gains, the drives with them, and `summary()`, which the command prints.

    Raises
    ------
    ParameterError
        A drive has an unknown scenario or setting, or a setting that its model file excludes; the scheduler does not
        answer; or `workers` and `scheduler` are both given.
    OptimisationError
        Every training drive ends stuck with all gains; `status` of the error has the scores of constant duty.
    DataError
        The folder or a model file cannot be used, another process writes to the folder, or a model file has changed
        during the tuning.

    Examples
    --------
    >>> from rover_pin import tune_gains
    >>> tune_gains("studies/tune_onboard.toml", "out/tune").gains  # doctest: +SKIP
    """
    refuse_both(workers, scheduler)
    if isinstance(study, (str, Path)):
        study = read_tuning(study)
    # All scenarios are built once before the search, so that a mistake in one of them is reported at once.
    study = seal(study)
    for case in (*study.training, *study.held_out):
        build(case)
    # The folder stays locked until the results are written, and a stop tells the user how to continue.
    with alone_in(out), ending_workers(), workers_of(workers or -1, scheduler) as work:
        evaluations = Evaluations(None if out is None else Path(out), work, progress)
        try:
            result = _tune_law(study, evaluations)
        except (KeyboardInterrupt, SystemExit) as stop:
            stop.add_note(evaluations.resume_hint())
            raise
        return result if out is None else write_result(result, Path(out))


def _tune_law(study: TuningStudy, evaluations: Evaluations) -> TuningResult:
    """Run a tuning and return its result: search, polish, choice and report. The scenarios of the study have been
    checked before.
    """
    begin = time.perf_counter()
    # Where the reduced model cannot be trusted, the search uses the full rover.
    checks = worse_checks(study, evaluations)
    # The steps of a tuning: search, polish of the best points, and drives of the full rover with the best gains.
    points = search(study, evaluations, checks)
    polished = [polish(study, evaluations, start) for start in spread_points(points, study.effort.starts)]
    candidates = evaluate_points(study, evaluations, [*spread_points(points, study.effort.keep), *polished])
    # Constant duty is the comparison, also in the message if no gains get any drive through.
    jobs = [(case, Control.of(CONSTANT_DUTY, study.law_before)) for case in study.training]
    constant = tuple(Score(*score) for score in evaluations.run("constant duty", full_score, jobs))
    if all(score.stuck for candidate in candidates for score in candidate.scores):
        stuck = int(sum(score.stuck for score in constant))
        raise OptimisationError(
            f"Tuning '{study.name}': every training drive ends stuck with each of the {len(candidates)} sets of gains "
            f"that the full simulation tried. With the constant duty {study.before.delta_0:g}, the cost is "
            f"{study.cost.mean(np.array(constant)):.3f}, and {stuck} of {len(constant)} drives end stuck. Choose "
            "gentler drives, or do not use this control.",
            status=constant,
        )
    # The full rover decides; fewer burials come first.
    best = min(candidates, key=lambda candidate: float(study.cost.choice(np.array(candidate.scores))))
    # Notes for the report: on which drives the search used the full rover, and what the polish gained.
    notes = []
    refused = [check for check in checks if not check.trusted]
    if not study.has_reduced_model:
        notes.append("the search uses the full rover, because the reduced model has no sensors and no holes")
    elif refused:
        notes.append(f"the search uses the full rover on {len(refused)} of {len(checks)} drives: {refusal(refused)}")
    if polished:
        costs = ", ".join(f"{point.before:.4f} to {point.cost:.4f}" for point in polished)
        notes.append(f"the polish on the full rover reduced the cost of the best starts from {costs}")
    # The report compares constant duty, constant duty with the torque check, and the slip control before and after the
    # tuning with each slip estimate. The full rover drives all drives with each of these controls.
    laws = {"constant duty": (CONSTANT_DUTY, study.law_before), "torque check": (TORQUE_CHECK, study.law_before)}
    for estimate in study.compared:
        laws[f"before, {estimate}"] = (estimate, study.law_before)
        laws[f"tuned, {estimate}"] = (estimate, best.law)
    runs = (*study.training_runs, *study.held_out_runs)
    jobs = [
        (run.case, Control.of(name, numbers, run.seed, study.believes))
        for name, numbers in laws.values()
        for run in runs
    ]
    # The flat list of scores is divided into one row for each control, and each row into training and held-out drives.
    scores = [Score(*score) for score in evaluations.run("report on all drives", full_score, jobs)]
    rows = [tuple(scores[i * len(runs) : (i + 1) * len(runs)]) for i in range(len(laws))]
    split = len(study.training_runs)
    return TuningResult(
        study,
        best.law,
        candidates,
        tuple(ControlScores(name, row[:split], row[split:]) for name, row in zip(laws, rows, strict=True)),
        tuple((check.case.name, *check[1:]) for check in check_drives(study, evaluations, best.law)),
        evaluations.fresh,
        time.perf_counter() - begin,
        cautions=cautions((*study.training, *study.held_out)),
        search_notes=tuple(notes),
        trials=tuple(point.trial for point in points if point.trial),
    )


def search(study: TuningStudy, evaluations: Evaluations, checks: Sequence[ReducedModelCheck]) -> list[SearchPoint]:
    """Search the unit cube of all free numbers by differential evolution, and return every point that was evaluated.

    `checks` state which drives the reduced model may replace. The gains before the tuning are in the first population.
    """
    effort, size = study.effort, len(study.free)
    points: list[SearchPoint] = []

    def costs(places: np.ndarray) -> np.ndarray:
        scores = search_scores(study, evaluations, [study.law(place) for place in places.T], checks)
        choices = np.asarray(study.cost.choice(scores))
        for place, choice, drives in zip(places.T, choices, scores, strict=True):
            points.append(SearchPoint(place.copy(), float(choice), "search", Trial.of(drives)))
        return choices

    # The first population covers the range evenly and contains the gains before the tuning.
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
    return points


def search_scores(
    study: TuningStudy, evaluations: Evaluations, laws: Sequence[SlipLaw], checks: Sequence[ReducedModelCheck]
) -> np.ndarray:
    """Return the scores of all training drives with each slip control in `laws`, an array (laws, drives, fields of a
    score).

    If the check of a drive in `checks` allows the reduced model, the scores of this drive come from the reduced model;
    otherwise they come from the full rover (the complete simulation).
    """
    runs, trusted = study.training_runs, {check.case.name for check in checks if check.trusted}
    scores = np.zeros((len(laws), len(runs), len(Score._fields)))
    # The reduced model and the full rover score different drives; together they fill the array.
    for is_reduced, stage, score in (
        (True, "search on the reduced model", reduced_score),
        (False, "search on the full rover", full_score),
    ):
        places = [i for i, run in enumerate(runs) if (run.case.name in trusted) == is_reduced]
        jobs = [job_of(study, law, runs[i]) for law in laws for i in places]
        if jobs:
            scores[:, places] = np.reshape(evaluations.run(stage, score, jobs), (len(laws), len(places), -1))
    return scores


def job_of(study: TuningStudy, law: SlipLaw, run: SeededDrive) -> tuple[Any, ...]:
    """Return the arguments of `full_score` or `reduced_score` for the drive `run` with the slip control `law`."""
    return run.case, Control.of(study.estimate, law, run.seed, study.believes)


def reduced_costs(study: TuningStudy, evaluations: Evaluations, laws: Sequence[SlipLaw]) -> np.ndarray:
    """Return the cost of all training drives with each slip control in `laws`, an array (laws,). All drives are drives
    of the reduced model.
    """
    # Checks without errors let the search use the reduced model on every drive.
    everywhere = [ReducedModelCheck(case, 0.0, 0.0, 0.0) for case in study.training]
    return study.cost.mean(search_scores(study, evaluations, laws, everywhere))


def polish(study: TuningStudy, evaluations: Evaluations, start: SearchPoint) -> SearchPoint:
    """Descend from a point of the search by the method of Nelder and Mead, with drives of the full rover, and return
    the best point.

    The result is not worse than the start.
    """
    # The cost at the start of the descent is kept, so that the report can state the improvement.
    size, costs = len(start.place), []

    def cost(place: np.ndarray) -> float:
        jobs = [job_of(study, study.law(place), run) for run in study.training_runs]
        costs.append(float(study.cost.choice(np.array(evaluations.run("polish on the full rover", full_score, jobs)))))
        return costs[-1]

    # The first simplex points into the cube, because a point outside would be clipped and the simplex would be flat.
    inward = np.where(start.place > 0.5, -MIN_DISTANCE, MIN_DISTANCE)
    options = {"initial_simplex": np.vstack([start.place, start.place + np.diag(inward)]), "maxfev": study.effort.steps}
    result = minimize(cost, start.place, method="Nelder-Mead", bounds=[(0.0, 1.0)] * size, options=options)
    return SearchPoint(np.clip(result.x, 0.0, 1.0), float(result.fun), "polish", before=costs[0])


def spread_points(points: Sequence[SearchPoint], count: int) -> list[SearchPoint]:
    """Return up to `count` points of lowest cost, sorted by cost. A point that is close to a better point is not
    returned.
    """
    # Points close to a better one would only repeat it.
    selected: list[SearchPoint] = []
    for point in sorted(points, key=lambda candidate: candidate.cost):
        if len(selected) < count and all(
            np.max(np.abs(point.place - earlier.place)) > MIN_DISTANCE for earlier in selected
        ):
            selected.append(point)
    return selected


def evaluate_points(
    study: TuningStudy, evaluations: Evaluations, points: Sequence[SearchPoint]
) -> tuple[Candidate, ...]:
    """Return the candidates of a tuning: the gains before the tuning and the gains at each point, with their scores.

    The full rover (the complete simulation) drives all training drives with each of these gains.
    """
    # The gains before the tuning are a candidate too, so that the result is never worse.
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
    """Return the point of the unit cube, an array with a coordinate for each free number, that belongs to the numbers
    in `law`. This is the inverse of `TuningStudy.law`.

    A number outside its bounds is moved to the nearest bound.
    """
    place = []
    for name, (low, high) in study.free.items():
        value = min(max(law.number(name), low), high)
        place.append(
            math.log(value / low) / math.log(high / low) if name in LOGARITHMIC else (value - low) / (high - low)
        )
    return np.array(place)
