"""One case, run: what is driven, and the row that comes of it."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rover_pin.base.errors import CacheError, DataError, MissingExtraError, ParameterError
from rover_pin.sweep.axis import plain
from rover_pin.sweep.study import Case, Study

CaseFunction = Callable[[Study, Case], Mapping[str, Any]]
"""What runs a case and returns its outcomes: name -> number, text, true/false or None."""
Row = dict[str, Any]
MOST_TRIED = 20
UNKNOWN_NAME = ("There is no scenario", "There is no setting")
LEADING = ("case", "repeat", "seed", "key")
"""Columns before the parameters; the outcomes, in alphabetical order, and `error` come after them."""


def drive_case(study: Study, case: Case) -> Mapping[str, Any]:
    """Return the summary of the study's scenario, driven with the case's values; `stop` says why it ended.

    Sentences, such as warnings, stand in one cell.
    """
    summary = scenario_of(study, case).drive().summary()
    return {name: "; ".join(value) if isinstance(value, list | tuple) else value for name, value in summary.items()}


def scenario_of(study: Study, case: Case) -> Any:
    """Return the scenario with the case's values; a terrain of chance is made from the case's seed."""
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.scenarios.scenes import SCENES

    times = {name: getattr(study, name) for name in ("duration", "dt") if getattr(study, name) is not None}
    settings = {**times, "trust": study.trust, **study.settings, **case.values}
    if study.scenario in SCENES and "seed" in inspect.signature(SCENES[study.scenario].terrain).parameters:
        settings.setdefault("terrain.seed", case.seed)
    return scenario(study.scenario, **settings)


def check_names(study: Study, cases: Sequence[Case]) -> None:
    """Refuse a scenario or setting that does not exist, before every case fails by it.

    A value that is not allowed is left to its case; only if the scenario can be built are its names known to be good.
    """
    for case in cases[:MOST_TRIED]:
        try:
            scenario_of(study, case)
            return
        except ParameterError as error:
            if str(error).startswith(UNKNOWN_NAME):
                raise ParameterError(f"study '{study.name}': {error}") from error


def run_case(study: Study, case_function: CaseFunction, case: Case) -> Row:
    """Return the case's row; whatever goes wrong in it becomes the row's `error`. Wall time is no part of a row.

    Raises MissingExtraError, CacheError: the machine, not the case, lacks something: a C compiler, an optional package,
    a folder for compiled code.
    """
    try:
        outcomes = _check_outcomes(study, case_function(study, case))
    except (MissingExtraError, CacheError):
        raise
    except Exception as error:
        return failed_row(case, error)
    return {**_head(case), **outcomes, "error": None}


def failed_row(case: Case, error: BaseException) -> Row:
    """Return the row of a case that gave no outcomes."""
    return {**_head(case), "error": f"{type(error).__name__}: {error}"}


def _head(case: Case) -> Row:
    values = {name: _cell(value) for name, value in case.values.items()}
    return {"case": case.index, "repeat": case.repeat, "seed": case.seed, "key": case.key, **values}


def _check_outcomes(study: Study, outcomes: Mapping[str, Any]) -> Row:
    if not isinstance(outcomes, Mapping):
        raise DataError(f"the case's function returned {type(outcomes).__name__}; it must return a mapping.")
    for name, value in outcomes.items():
        if name in LEADING or name == "error" or name in study.parameters:
            raise DataError(f"the outcome '{name}' has the name of another column; rename it.")
        if not (value is None or isinstance(plain(value), (bool, int, float, str))):
            raise DataError(f"the outcome '{name}' is {type(value).__name__}; give a number, text or true/false.")
    return {name: _cell(outcomes[name]) for name in sorted(outcomes)}


def _cell(value: Any) -> Any:
    value = plain(value)
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
