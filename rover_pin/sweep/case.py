"""Running of one case of a study, and its row in the table of results."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rover_pin.base.errors import CacheError, DataError, MissingExtraError, ParameterError, UnknownNameError
from rover_pin.sweep.plan import plain
from rover_pin.sweep.study import Case, Study

CaseFunction = Callable[[Study, Case], Mapping[str, Any]]
"""A function that runs one case of a study and returns its outcomes: name -> number, text, true/false or None."""
Row = dict[str, Any]
"""One row of the table of results: name of a column -> value."""
MAX_CASES_CHECKED = 20
"""Largest number of cases that are built before a sweep starts, to find names that do not exist. If the values of all
these cases are refused for another reason, the names are not checked, and each case reports its own error. More cases
would delay the start of the sweep."""
LEADING = ("case", "repeat", "seed", "key")
"""First columns of the table of results. The columns of the parameters follow, then the outcomes in alphabetical order,
then `error`."""


def drive_case(study: Study, case: Case) -> Mapping[str, Any]:
    """Drive the scenario of the study with the values of the case, and return the summary of the drive.

    A sweep without another case function runs its cases with this function. The outcome `stop` states why the drive
    ended. If an outcome has several sentences, such as warnings, they are joined into one cell.
    """
    summary = scenario_of(study, case).drive().summary()
    return {name: "; ".join(value) if isinstance(value, list | tuple) else value for name, value in summary.items()}


def scenario_of(study: Study, case: Case) -> Any:
    """Return the scenario of a study with the values of a case. A random terrain is made from the seed of the case."""
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.scenarios.scenes import SCENES

    # The study's duration and time step replace the scenario's. The values of the case come last, because they replace
    # all other settings.
    times = {name: getattr(study, name) for name in ("duration", "dt") if getattr(study, name) is not None}
    settings = {**times, "trust": study.trust, **study.settings, **case.values}
    if study.scenario in SCENES and "seed" in inspect.signature(SCENES[study.scenario].terrain).parameters:
        settings.setdefault("terrain.seed", case.seed)
    return scenario(study.scenario, **settings)


def check_names(study: Study, cases: Sequence[Case]) -> None:
    """Check that the scenario and all settings of a sweep exist. An unknown name would make every case fail.

    A value that is not allowed is not reported here, because it may concern one case only; the row of this case reports
    it.

    Raises UnknownNameError: a name is unknown; the message has the name of the study.
    """
    for case in cases[:MAX_CASES_CHECKED]:
        try:
            # A refused value can hide an unknown name, so cases are tried until one scenario can be built.
            scenario_of(study, case)
            return
        except UnknownNameError as error:
            raise UnknownNameError(f"study '{study.name}': {error}") from error
        except ParameterError:
            continue


def run_case(study: Study, case_function: CaseFunction, case: Case) -> Row:
    """Run a case and return its row of the table. If the case fails, the row contains the error in its column `error`.

    A row contains no run time, so that the results of two runs are equal to the byte.

    Raises MissingExtraError or CacheError if this computer lacks a C compiler, an optional package or a folder for
    compiled code. These errors would occur in every case, so they stop the sweep.
    """
    try:
        outcomes = case_function(study, case)
        # The outcomes of a user's function are checked, because they become columns of the table.
        if not isinstance(outcomes, Mapping):
            raise DataError(
                f"the case function returned an object of the type {type(outcomes).__name__}; it must return a mapping "
                "from names of outcomes to their values."
            )
        for name, value in outcomes.items():
            if name in LEADING or name == "error" or name in study.parameters:
                raise DataError(
                    f"the outcome '{name}' has the name of a parameter or of a fixed column of the table; rename it."
                )
            if not (value is None or isinstance(plain(value), (bool, int, float, str))):
                raise DataError(
                    f"the outcome '{name}' has the type {type(value).__name__}; give a number, a text or true/false."
                )
        cells = {name: _cell(outcomes[name]) for name in sorted(outcomes)}
    # A missing package or folder stops the sweep, because every case would fail. Any other error concerns this case
    # only, and becomes its row.
    except (MissingExtraError, CacheError):
        raise
    except Exception as error:
        return failed_row(case, error)
    # Outcomes are sorted by name, so that the columns do not depend on the order in which a function returns them.
    return {**_head(case), **cells, "error": None}


def failed_row(case: Case, error: BaseException) -> Row:
    """Return the row of a case that ended with an error. It contains the error and no outcomes."""
    return {**_head(case), "error": f"{type(error).__name__}: {error}"}


def _head(case: Case) -> Row:
    """Return the first columns of a case's row: the columns that identify the case (LEADING), then the values of its
    parameters.
    """
    values = {name: _cell(value) for name, value in case.values.items()}
    return {"case": case.index, "repeat": case.repeat, "seed": case.seed, "key": case.key, **values}


def _cell(value: Any) -> Any:
    """Return a value as a cell of the table. Whole numbers become floats, so that a column has one type in all rows."""
    value = plain(value)
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
