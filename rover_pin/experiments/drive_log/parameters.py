"""Numbers of a drive model by name, free to be fitted: soil, motor, effects, one coordinate u each."""

import re
from collections.abc import Sequence
from typing import Any

from rover_pin.estimation.experiment import find
from rover_pin.estimation.parameter import Parameter, parameter_of
from rover_pin.simulation.model.model import OWNERS, Model


def owner_name(effect: Any) -> str:
    """Return the name of an effect of a model: its class, and whose it is where a model may have several."""
    place = next((getattr(effect, owner) for owner in OWNERS if hasattr(effect, owner)), None)
    return type(effect).__name__ + ("" if place in (None, "") else f"[{place}]")


def with_wheels(text: str, wheels: Sequence[str], form: str) -> str:
    """Return a text with the `wheel` of an effect's `name` that has its `number` only, in a form of these three."""

    def name_wheel(match: re.Match[str]) -> str:
        return form.format(name=match[1], number=match[2], wheel=wheels[int(match[2])])

    return re.sub(r"(\w+)\[(\d+)\](?!\.)", name_wheel, text)


def owners(model: Model) -> dict[str, Any]:
    """Return the records of a model whose numbers can be fitted, by name."""
    return {
        "soil": model.soils[0],
        "motor": model.motor,
        **{owner_name(effect): effect for effect in model.all_effects},
    }


def with_record(model: Model, owner: str, record: Any) -> Model:
    """Return the model with another record of this owner."""
    if owner == "soil":
        return model.replace(soils=(record, *model.soils[1:]))
    return model.replace(motor=record) if owner == "motor" else model.having(record)


def parameter(
    model: Model, name: str, sd: float, log: bool = False, *, declared: str = "", source: str = ""
) -> Parameter:
    """Return the parameter of a model around its present value; `sd` is relative where `log`.

    `declared` says where the log declares it; without it is assumed, by `source` or that of the quantity.
    """
    return parameter_of(name, find(owners(model), name)[0], sd, log, declared, source)
