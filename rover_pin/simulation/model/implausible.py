"""Sizes of effects that no rover of this geometry has: they are driven and fitted, and said."""

from rover_pin.rover.reach import reach_of
from rover_pin.simulation.model.model import Model


def implausible(model: Model) -> tuple[str, ...]:
    """Return a sentence for each axis along which effects put the base's centre of mass outside the rover's bodies."""
    loads = [effect for effect in model.body_effects if any(effect.ballast())]
    if not loads:
        return ()
    names, (low, high) = " and ".join(type(effect).__name__ for effect in loads), reach_of(model.rover)
    place = model.built.model.inertias[1].lever
    return tuple(
        f"{names} puts the base's centre of mass at {axis} = {1e3 * at:.0f} mm, outside the rover, whose bodies reach "
        f"from {1e3 * least:.0f} to {1e3 * most:.0f} mm there: it stands for something else, or the URDF is wrong"
        for axis, at, least, most in zip("xyz", place, low, high, strict=True)
        if not least <= at <= most
    )
