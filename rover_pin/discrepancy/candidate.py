"""Candidates for the cause of a residual: effects that a model may lack, and parameters of the model whose declared
values may be wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.cause import SIZE_SD, Cause

SHAPE_LOG_SD, SHAPE_RELATIVE_SD = 0.5, 0.3
"""Prior SD of a parameter that only changes the shape of an effect: SHAPE_LOG_SD on its logarithm, or SHAPE_RELATIVE_SD
times its value if it may be negative.

A fitted value further from the published one lowers the probability of the effect. The values are assumed: published
shapes differ by about this factor from soil to soil."""
PUBLISHED = "as published, its SD assumed"
"""Text that reports print as the source of an effect's shape parameter."""
PLACE_SPACING = 0.15
"""Distance [m] between the places along the path at which a local effect is tried, and prior SD of its place.

The fit then moves the edges of the stretch on which the effect acts. The value is about the diameter of a wheel,
because a wheel averages over shorter distances."""
DECLARED, USUAL_DEVIATION = "declaration", 10.0
"""DECLARED is the name of the family of candidates for wrong declared parameters. USUAL_DEVIATION is the usual
deviation of a wrong parameter from its declaration, in declared SDs.

The fit gives the parameter a prior of this width. The value is assumed: a wrong declaration (a wrong unit, a confused
column) is as a rule wrong by much."""
MAX_LINEAR_RATIO = 50.0
"""Minimum ratio of the neutral value of an effect's size (at which the effect vanishes) to its default value. Above
this value, the logarithm of the size is fitted.

On a linear scale, the neutral value would lie many steps away from the default, and a fit would not reach it. The value
50 separates thresholds, whose neutral values are practically infinite, from all other sizes."""
DEFAULT_SIZE = {"m": 0.01, "rad": 0.01}
"""Initial size in a fit if the default size of an effect is neutral (the effect vanishes at it), by unit: 10 mm and 10
mrad. The fit then determines the size, so that only the order of magnitude of the start matters."""
OTHER_DEFAULT_SIZE = 0.05
"""Initial size in a fit if the default size of an effect is neutral and its unit is not in DEFAULT_SIZE. The fit then
determines the size, so that only the order of magnitude of the start matters."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A possible cause of the residual: either an effect at its default size, or a freed parameter.

    A freed parameter is a parameter of the model that gets a wide prior, because its declared value may be wrong. An
    effect is an object with named quantities. Its mapping `neutral` holds the values of its sizes at which the effect
    vanishes, and its `places` are the quantities that locate the effect. Parameters have names of the form
    `owner.quantity`, where the owner is the effect or the part of the model that holds the quantity.
    """

    kind: str
    """name of the effect's class, or of the freed parameter"""
    effect: Any
    """the effect at its default size, or the part of the model that contains the freed parameter"""
    amplitudes: tuple[str, ...]
    """names of the sizes: the parameters that make the effect vanish if they have their neutral values"""
    shapes: tuple[str, ...] = ()
    """names of the parameters that only change the shape of the effect"""
    place: str = ""
    """location of the effect: a wheel, a joint, a channel, or the start of a stretch along the path [m]"""
    place_searched: bool = False
    """whether several places along the path are tried. The prior probability of the effect is then divided equally
    among these places"""
    released: Parameter | None = None
    """the freed parameter with its original prior; None for an effect"""

    @property
    def name(self) -> str:
        """Name of the candidate: its kind, followed by its place if it has one.

        Examples: `SlipSinkage`, `WeakMotor[fl]` for a wheel, `HardPatch@0.450` for a place along the path.
        """
        if not self.place:
            return self.kind
        return f"{self.kind}@{self.place}" if self.place_searched else f"{self.kind}[{self.place}]"

    @property
    def anywhere(self) -> str:
        """Name of the candidate without its place along the path. All places at which an effect is tried share this
        name.
        """
        return self.kind if self.place_searched else self.name

    @property
    def owner(self) -> str:
        """Name of the effect in a model, without a place along the path. For a freed parameter, it is the name of the
        part of the model that contains the parameter.
        """
        if self.released:
            return self.released.name.rpartition(".")[0]
        return self.kind if self.place_searched or not self.place else self.name

    def on(self, model: Any) -> Any:
        """Return the model with the effect added at its default size; for a freed parameter, the unchanged model."""
        return model if self.released else model.having(self.effect)

    @property
    def neutral(self) -> dict[str, float]:
        """Parameter name of each size -> value of the size at which the effect vanishes."""
        return {name: self.effect.neutral[name.rpartition(".")[2]] for name in self.amplitudes}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters of the candidate: sizes and shapes."""
        return (*self.amplitudes, *self.shapes)

    @property
    def cause(self) -> Cause:
        """The candidate as a `Cause` for a fit, with a prior for each parameter.

        Each size has a prior SD of SIZE_SD default sizes, and each shape parameter has the SD that is assumed for it.
        """
        amplitudes = tuple(
            replace(size, scale=SIZE_SD * size.scale, prior=True, source="assumed: default sizes")
            for size in map(self.size, self.amplitudes)
        )
        shapes = []
        for name in self.shapes:
            shape, log_sd = self.shape(name), quantities(self.effect)[name.rpartition(".")[2]].log_sd
            # If even the order of magnitude of a shape is assumed, the quantity states this uncertainty itself.
            shapes.append(replace(shape, scale=log_sd) if log_sd > 0.0 else shape)
        family = getattr(self.effect, "family", "") if is_effect(self.effect) else DECLARED
        return Cause(self.name, self.on, (*amplitudes, *shapes), frozenset(self.amplitudes), family, self.owner)

    def size(self, name: str) -> Parameter:
        """Return a size of the candidate as a parameter of a fit. At u = 0 the effect vanishes, and at u = 1 the size
        has the value of this candidate's effect.

        In three cases u has another scale. If the size of this candidate's effect is neutral, or if the freed parameter
        belongs to an effect, u = 1 is the default of the effect's class. If the freed parameter belongs to another part
        of the model, u = 1 is USUAL_DEVIATION declared SDs. If the neutral value is far from the default, u is the
        logarithm of the ratio to the default.
        """
        # A wrong declared number: it keeps its declared value as origin and gets a wider prior.
        if self.released and not is_effect(self.effect):
            return replace(self.released, scale=USUAL_DEVIATION * self.released.scale)
        quantity = name.rpartition(".")[2]
        spec, neutral = quantities(self.effect)[quantity], self.effect.neutral[quantity]
        default = float(getattr(self.effect, quantity))
        # An effect whose present size is neutral says nothing about its usual size; the default of its class does.
        if default == neutral or self.released:
            default = float(type(self.effect).__dataclass_fields__[quantity].default)
        low, high = float(spec.low), float(spec.high)
        # A threshold whose neutral value is practically infinite is fitted on a logarithm.
        if abs(neutral) > MAX_LINEAR_RATIO * abs(default):
            return Parameter(name, default, 1.0, low, high, log=True, prior=False)
        # The sign of the scale is that of the default, so that u = 1 is always the default size.
        scale = default - neutral or DEFAULT_SIZE.get(spec.unit, OTHER_DEFAULT_SIZE)
        if self.released:
            return replace(self.released, scale=1.0 if self.released.log else scale)
        return Parameter(name, neutral, scale, low, high, prior=False)

    def shape(self, name: str) -> Parameter:
        """Return a shape parameter of the effect as a parameter of a fit, with a prior around its present value."""
        quantity = name.rpartition(".")[2]
        spec, value = quantities(self.effect)[quantity], float(getattr(self.effect, quantity))
        low, high = float(spec.low), float(spec.high)
        # A position along the path: it may move by about one spacing of the tried places.
        if quantity.startswith("x_"):
            return Parameter(name, value, PLACE_SPACING, low, high, source="sought along the way")
        if spec.low >= 0 and value > 0:
            return Parameter(name, value, SHAPE_LOG_SD, low, high, log=True, declared=True, source=PUBLISHED)
        scale = SHAPE_RELATIVE_SD * (abs(value) or 1.0)
        return Parameter(name, value, scale, low, high, declared=True, source=PUBLISHED)


def plain_candidate(effect: Any, owner: str = "") -> Candidate:
    """Return an effect as a candidate whose quantities are all free parameters of the fit.

    Parameters
    ----------
    effect : Effect
        The effect at its default size.
    owner : str, optional
        Name of the effect in a model, `Kind[place]` if it acts at one place; by default the name of its class.

    Example: `plain_candidate(SlipSinkage()).amplitudes` is `("SlipSinkage.n_1",)`.
    """
    owner = owner or type(effect).__name__
    # "WeakMotor[fl]" is the kind WeakMotor at the place fl.
    kind, _, place = owner.partition("[")
    shapes = tuple(f"{owner}.{name}" for name in quantities(effect) if name not in effect.neutral)
    amplitudes = tuple(f"{owner}.{name}" for name in effect.neutral)
    return Candidate(kind, effect, amplitudes, shapes, place.rstrip("]"))


def released_candidate(number: Parameter, records: Mapping[str, Any]) -> Candidate:
    """Return a candidate that frees a parameter of the model: the parameter gets a wide prior, because its declared
    value may be wrong.

    `number` is this parameter, and `records` maps names to the parts of the model, such as the soil and the effects.
    """
    # A freed parameter of an effect also needs the neutral value of its size, which the effect holds.
    owner = number.name.rpartition(".")[0]
    if not is_effect(records[owner]):
        return Candidate(number.name, records[owner], (number.name,), released=number)
    return replace(plain_candidate(records[owner], owner), amplitudes=(number.name,), shapes=(), released=number)


def is_effect(record: Any) -> bool:
    """Return whether a part of a model is an effect, and not for example the soil. Only an effect has an attribute
    `neutral`, with the values at which it vanishes.
    """
    return hasattr(record, "neutral")
