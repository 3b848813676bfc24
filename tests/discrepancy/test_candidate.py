"""Candidates by name, the coordinates of their sizes and shapes, and how often the base model is started."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from rover_pin.base.quantity import Record, quantity
from rover_pin.discrepancy import calibration
from rover_pin.discrepancy.calibration import is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.estimation.parameter import Parameter


def made_kind(default, neutral, low, high, unit="m"):
    @dataclass(frozen=True)
    class Kind(Record):
        """An effect of one number."""

        x: float = quantity(default, unit, "made", low, high, "x")
        neutral: ClassVar[dict[str, float]] = {"x": 0.0}

    Kind.neutral = {"x": neutral}
    return Kind()


@pytest.mark.parametrize(
    ("default", "neutral", "log", "scale"),
    [(0.1, 10.0, True, 1.0), (10.0, 100.0, False, -90.0), (0.3, 0.0, False, 0.3), (0.0, 0.0, False, 0.01)],
)
def test_size_scale_is_linear_from_neutral_or_logarithmic_if_far(default, neutral, log, scale):
    """Far off is beyond fifty times the default; a size without a default goes by a hundredth."""
    effect = made_kind(default, neutral, 0.0, 1e3)
    found = Candidate("Kind", effect, ("Kind.x",)).size("Kind.x")
    assert (found.log, found.scale, found.prior) == (log, pytest.approx(scale), False)
    assert found.value(0.0) == (default if log else neutral)


@pytest.mark.parametrize(
    ("value", "low", "log", "sd"),
    [
        (0.5, 0.0, True, 0.5),
        (2.0, 0.0, True, 0.5),
        (0.0, 0.0, False, 0.3),
        (0.5, -1.0, False, 0.15),
        (-0.5, -1.0, False, 0.15),
    ],
)
def test_shape_prior_is_half_its_logarithm_or_three_tenths_of_it(value, low, log, sd):
    effect = made_kind(0.1, 0.0, low, 9.0).replace(x=value)
    found = Candidate("Kind", effect, (), ("Kind.x",)).shape("Kind.x")
    assert (found.log, found.scale, found.prior) == (log, pytest.approx(sd), True)
    assert found.value(0.0) == value


def test_a_size_has_no_prior_and_a_place_has_sd_of_15_cm():
    patch = Candidate("HardPatch", HardPatch(), ("HardPatch.g",), ("HardPatch.x_from",))
    size, place = patch.size("HardPatch.g"), patch.shape("HardPatch.x_from")
    assert (size.prior, place.prior) == (False, True)
    assert (place.scale, place.log) == (0.15, False)


def test_neutral_effect_is_tried_at_the_default_of_its_class():
    for c_r, scale in ((0.0, 0.05), (0.2, 0.2)):
        one = Candidate("RateDependence", RateDependence(c_r=c_r), ("RateDependence.c_r",)).size("RateDependence.c_r")
        assert (one.origin, one.scale) == (0.0, scale)


@pytest.mark.parametrize(
    ("place", "sought", "name", "owner"),
    [("", False, "Weak", "Weak"), ("2", False, "Weak[2]", "Weak[2]"), ("1.5", True, "Weak@1.5", "Weak")],
)
def test_a_place_on_the_way_does_not_belong_to_the_effects_name(place, sought, name, owner):
    one = Candidate("Weak", object(), (), place=place, place_searched=sought)
    assert (one.name, one.owner) == (name, owner)


@pytest.mark.parametrize(
    ("u", "prior", "bent"), [(3.1, True, True), (-3.1, True, True), (2.9, True, False), (9.0, False, False)]
)
def test_a_number_three_sd_from_what_is_declared_is_bent(u, prior, bent):
    others = (Parameter("a", 0.0, 1.0, -9, 9), Parameter("b", 0.0, 1.0, -9, 9, prior=prior))
    assert is_bent(SimpleNamespace(parameters=others, u=np.array([0.1, u]))) is bent


def test_an_exact_experiment_is_calibrated_from_several_starts(monkeypatch):
    seen = []
    monkeypatch.setattr(calibration, "scattered", lambda numbers, centre, starts, seed: [(starts, seed, *centre)])
    monkeypatch.setattr(calibration, "best_of", lambda task, model, numbers, starts: seen.append(starts[0]) or "best")
    monkeypatch.setattr(calibration, "fit", lambda task, model, numbers: "once")
    monkeypatch.setattr(calibration, "again", lambda fitted: f"{fitted} more")
    experiment = lambda exact: SimpleNamespace(is_exact=exact, noise=lambda: "declared", value=lambda model, name: 3.0)  # noqa: E731
    one = Parameter("k", 1.0, 0.5, 0.0, 9.0)
    assert calibration.calibrated(experiment(True), "model", [one], 7) == "best"
    assert [list(one) for one in seen] == [[calibration.STARTS, 7, 4.0]]
    assert calibration.calibrated(experiment(False), "model", [one], 7) == "once more"
