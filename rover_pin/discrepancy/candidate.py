"""One thing that a model may lack: an effect of any kind, or numbers of the model that its priors may hold wrongly."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.cause import SIZE_SD, Cause

SHAPE_SD, SHAPE_SHARE = 0.5, 0.3
"""Prior SD of an effect's shape: of its logarithm, or as a share of its size where it may be negative. Why: published
shapes differ by as much from soil to soil (assumed)."""
PUBLISHED = "as published, its SD assumed"
"""Who says how an effect's shape is."""
SPACING = 0.15
"""Distance of the places at which an effect is tried, and prior SD of its place [m]. Why: about a wheel's size."""
DECLARED, DEVIATION = "declaration", 10.0
"""Family of numbers that are not as declared, and their usual deviation in the declared SDs (assumed). Why: a
declaration that is wrong is wrong by much."""
FAR_FROM = 50.0
"""Ratio of neutral to default value from which an effect's size is sought on a logarithm."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect at its default size at some place, or one that the model has, a number of it freed from its prior.

    An effect is a record of quantities that names the `neutral` values of its sizes, at which it vanishes, and its
    `places`; `amplitudes` and `shapes` are names of parameters, `owner.quantity`.
    """

    kind: str
    "what it is: the name of the effect"
    effect: Any
    amplitudes: tuple[str, ...]
    shapes: tuple[str, ...] = ()
    place: str = ""
    "where it is: a wheel, a joint, a channel, or the begin of a stretch of the way [m]"
    place_searched: bool = False
    "whether that place was sought along the way, so that chance had more to choose from"
    released: Parameter | None = None
    "the number of an effect of the model, as it is known beforehand, that may be otherwise"

    @property
    def name(self) -> str:
        """Kind and place."""
        if not self.place:
            return self.kind
        return f"{self.kind}@{self.place}" if self.place_searched else f"{self.kind}[{self.place}]"

    @property
    def anywhere(self) -> str:
        """Its name, wherever along the way it is."""
        return self.kind if self.place_searched else self.name

    @property
    def owner(self) -> str:
        """The name under which a model holds the effect; a place on the way does not belong to it."""
        if self.released:
            return self.released.name.rpartition(".")[0]
        return self.kind if self.place_searched or not self.place else self.name

    def on(self, model: Any) -> Any:
        """Return the model with the effect at its default size."""
        return model if self.released else model.having(self.effect)

    @property
    def neutral(self) -> dict[str, float]:
        """The values of the sizes at which the effect vanishes."""
        return {name: self.effect.neutral[name.rpartition(".")[2]] for name in self.amplitudes}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the candidate's numbers: amplitudes and shapes."""
        return (*self.amplitudes, *self.shapes)

    @property
    def cause(self) -> Cause:
        """The effect as a cause: sizes of SD SIZE_SD, shapes as published or within their doubt."""
        amplitudes = tuple(
            replace(size, scale=SIZE_SD * size.scale, prior=True, source="assumed: default sizes")
            for size in map(self.size, self.amplitudes)
        )
        shapes = map(self._shape_with_prior, self.shapes)
        family = getattr(self.effect, "family", "") if is_effect(self.effect) else DECLARED
        return Cause(self.name, self.on, (*amplitudes, *shapes), frozenset(self.amplitudes), family, self.owner)

    def size(self, name: str) -> Parameter:
        """Return the parameter of a size: u = 0 neutral, u = 1 the effect's own; a logarithm where neutral is far off.

        An effect that is at its neutral value is tried at the default of its class, and so is a freed number, about
        what is known of it.
        """
        if self.released and not is_effect(self.effect):
            return replace(self.released, scale=DEVIATION * self.released.scale)
        quantity = name.rpartition(".")[2]
        spec, neutral = quantities(self.effect)[quantity], self.effect.neutral[quantity]
        default = float(getattr(self.effect, quantity))
        if default == neutral or self.released:
            default = float(type(self.effect).__dataclass_fields__[quantity].default)
        low, high = float(spec.low), float(spec.high)
        if abs(neutral) > FAR_FROM * abs(default):
            return Parameter(name, default, 1.0, low, high, log=True, prior=False)
        scale = default - neutral or _reach(spec.unit)
        if self.released:
            return replace(self.released, scale=1.0 if self.released.log else scale)
        return Parameter(name, neutral, scale, low, high, prior=False)

    def shape(self, name: str) -> Parameter:
        """Return the parameter of a shape, with a prior around its present value."""
        quantity = name.rpartition(".")[2]
        spec, value = quantities(self.effect)[quantity], float(getattr(self.effect, quantity))
        low, high = float(spec.low), float(spec.high)
        if quantity.startswith("x_"):
            return Parameter(name, value, SPACING, low, high, source="sought along the way")
        if spec.low >= 0 and value > 0:
            return Parameter(name, value, SHAPE_SD, low, high, log=True, declared=True, source=PUBLISHED)
        scale = SHAPE_SHARE * (abs(value) or 1.0)
        return Parameter(name, value, scale, low, high, declared=True, source=PUBLISHED)

    def _shape_with_prior(self, name: str) -> Parameter:
        """Return the parameter of a shape; of one of which even the order is assumed its doubt is the prior."""
        shape, log_sd = self.shape(name), quantities(self.effect)[name.rpartition(".")[2]].log_sd
        return replace(shape, scale=log_sd) if log_sd > 0.0 else shape


def plain_candidate(effect: Any, owner: str = "") -> Candidate:
    """Return an effect as a candidate, all its quantities free; `owner` is its name, kind[place], if it has a place."""
    owner = owner or type(effect).__name__
    kind, _, place = owner.partition("[")
    shapes = tuple(f"{owner}.{name}" for name in quantities(effect) if name not in effect.neutral)
    amplitudes = tuple(f"{owner}.{name}" for name in effect.neutral)
    return Candidate(kind, effect, amplitudes, shapes, place.rstrip("]"))


def released_candidate(number: Parameter, records: Mapping[str, Any]) -> Candidate:
    """Return a number of a model's records, one of an effect or not, as a candidate, freed from its prior."""
    owner = number.name.rpartition(".")[0]
    if not is_effect(records[owner]):
        return Candidate(number.name, records[owner], (number.name,), released=number)
    return replace(plain_candidate(records[owner], owner), amplitudes=(number.name,), shapes=(), released=number)


def is_effect(record: Any) -> bool:
    """Return whether a record of a model is an effect: it names the values at which it vanishes."""
    return hasattr(record, "neutral")


def _reach(unit: str) -> float:
    """Return a size of one unit for an effect whose default for it is none: a hundredth [m, rad, ...]."""
    return {"m": 0.01, "rad": 0.01}.get(unit, 0.05)
