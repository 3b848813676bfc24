"""Numbers of a drive model by name, free to be fitted: soil, motor, effects, one coordinate u each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rover_pin.errors import ParameterError, closest
from rover_pin.motion.model import OWNERS, Model
from rover_pin.quantity import Quantity, quantities

GROUND = 0
"""Index of the soil that is fitted."""
MOST_EXPONENT = 700.0
"""Greatest exponent of which a float holds the exponential; beyond every bound."""


def owner_name(effect: Any) -> str:
    """Return the name of an effect of a model: its class, and whose it is where a model may have several."""
    place = next((getattr(effect, owner) for owner in OWNERS if hasattr(effect, owner)), None)
    return type(effect).__name__ + ("" if place in (None, "") else f"[{place}]")


def owners(model: Model) -> dict[str, Any]:
    """Return the records of a model whose numbers can be fitted, by name."""
    return {
        "soil": model.soils[GROUND],
        "motor": model.motor,
        **{owner_name(effect): effect for effect in model.all_effects},
    }


def find(model: Model, name: str) -> tuple[Any, str, Quantity]:
    """Return the record, the field and what is known of a parameter named `owner.field`."""
    own, _, field = name.rpartition(".")
    records = owners(model)
    if own not in records:
        raise ParameterError(f"The model has no '{own}' to fit: {closest(own, records)}")
    known = quantities(records[own])
    if field not in known:
        raise ParameterError(f"'{own}' has no number '{field}': {closest(field, known)}")
    return records[own], field, known[field]


def value_of(model: Model, name: str) -> float:
    """Return the value of a parameter."""
    record, field, _ = find(model, name)
    return float(getattr(record, field))


def with_values(model: Model, values: dict[str, float]) -> Model:
    """Return the model with these values of parameters."""
    for name, value in values.items():
        record, field, _ = find(model, name)
        changed = record.replace(**{field: value})
        own = name.rpartition(".")[0]
        if own == "soil":
            model = model.replace(soils=(changed, *model.soils[1:]))
        elif own == "motor":
            model = model.replace(motor=changed)
        else:
            model = model.having(changed)
    return model


@dataclass(frozen=True)
class Parameter:
    """One free number: x = origin + scale u, or x = origin exp(scale u) where `log`.

    With a prior u is standard normal: `origin` is what was declared and `scale` its standard deviation. `fd` is the
    step of u for a derivative.
    """

    name: str
    origin: float
    scale: float
    low: float
    high: float
    log: bool = False
    prior: bool = True
    fd: float = 0.3

    def value(self, u: float) -> float:
        """Return x at u."""
        x = self.origin * math.exp(min(self.scale * u, MOST_EXPONENT)) if self.log else self.origin + self.scale * u
        return min(max(x, self.low), self.high)

    def u(self, x: float) -> float:
        """Return u of x."""
        return math.log(x / self.origin) / self.scale if self.log else (x - self.origin) / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds of u."""
        low = -math.inf if self.log and self.low <= 0 else self.u(self.low)
        return min(low, self.u(self.high)), max(low, self.u(self.high))

    def slope(self, u: float) -> float:
        """Return dx / du."""
        return self.scale * (self.value(u) if self.log else 1.0)


def parameter(model: Model, name: str, sd: float, log: bool = False, prior: bool = True) -> Parameter:
    """Return the parameter of a model around its present value; `sd` is relative where `log`."""
    _, _, about = find(model, name)
    return Parameter(name, value_of(model, name), sd, float(about.low), float(about.high), log, prior)
