"""How long tuning five drives takes, beside Nelder-Mead on the same model in the same run.

Question
    Do five drives take 60 s at most on two cores, and are the global search and the derivatives worth it?
Method
    `tune_gains` on studies/tune_slopes.toml without its held-out drives; then Nelder-Mead from the gains before, on the
    same reduced model without smoothing, with as many evaluations as a user would wait for (120), its result judged by
    the full rover too. Workers are started before either clock.
Result
    On two cores shared with much other work (load 12): tune_gains 239 s for 345 single drives, reports included, about
    55 s of them processor time; cost 0.3735 on the full rover. Nelder-Mead 32 s for 590 drives of the reduced model,
    0.6542: it ends in a valley of its own, on the reduced model too (0.5173 against 0.3757). The gains before: 0.6485.
What the paper says
    Nothing: it gives no gains and no way to them.
What differs
    Nothing to differ from.

Run: python studies/benchmarks/tuning.py [--quick] [--workers N]
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import time
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from rover_pin.tuning.drive_score import Score
from rover_pin.tuning.drives import full_score
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.study import Effort, SlipLaw, TuningStudy
from rover_pin.tuning.study_file import read_tuning
from rover_pin.tuning.tune import job_of, place_of, reduced_costs, tune_gains

EXAMPLE = Path(__file__).parents[1] / "tune_slopes.toml"
EVALUATIONS = 120


def main() -> None:
    """Time both and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two drives and hardly any search: shows that it runs")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    study = dataclasses.replace(read_tuning(EXAMPLE), held_out=())
    if options.quick:
        effort = Effort(population=5, generations=0, starts=1, steps=1, keep=1)
        study = dataclasses.replace(study, training=study.training[-2:], effort=effort)
    full_costs(study, study.law_before, options.workers)
    print(f"{len(study.training)} drives, {options.workers} workers, load before {os.getloadavg()[0]:.1f}")
    result = tune_gains(study, workers=options.workers)
    reduced, full = min((each.cost, each.reduced_cost) for each in result.candidates)[::-1]
    told(f"tune_gains:  {result.seconds:6.1f} s, {result.evaluations} drives", reduced, full)
    begin = time.perf_counter()
    gains, reduced, count = nelder_mead(study, 10 if options.quick else EVALUATIONS, options.workers)
    full = full_costs(study, gains, options.workers)
    seconds = time.perf_counter() - begin
    told(f"Nelder-Mead: {seconds:6.1f} s, {count} drives", reduced, full)
    told("gains before", result.candidates[0].reduced_cost, result.candidates[0].cost)


def told(what: str, reduced: float, full: float) -> None:
    """Print a line of the comparison."""
    print(f"{what}: cost {reduced:.4f} on the reduced model, {full:.4f} on the full rover")


def full_costs(study: TuningStudy, law: SlipLaw, workers: int) -> float:
    """Return the ensemble's cost on the full rover."""
    jobs = [job_of(study, law, run) for run in study.training_runs]
    scores = Evaluations(None, workers, None).run("full rover", full_score, jobs)
    return float(study.cost.over(np.array([Score(*score).cost(study.cost) for score in scores])))


def nelder_mead(study: TuningStudy, most: int, workers: int) -> tuple[SlipLaw, float, int]:
    """Return the gains, their reduced cost and how many single drives that took."""
    evaluations = Evaluations(None, workers, None)

    def cost(place: np.ndarray) -> float:
        return float(reduced_costs(study, evaluations, [study.law(np.clip(place, 0.0, 1.0))])[0])

    found = minimize(cost, place_of(study, study.law_before), method="Nelder-Mead", options={"maxfev": most})
    return study.law(np.clip(found.x, 0.0, 1.0)), float(found.fun), evaluations.fresh


if __name__ == "__main__":
    main()
