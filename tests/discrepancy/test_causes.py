"""Effects as causes: sizes about none, shapes as published or within their doubt; numbers that nobody declares."""

from dataclasses import replace

import pytest

from rover_pin.discrepancy.candidate import plain_candidate
from rover_pin.discrepancy.conclude import PRIOR_WIDENING, proper
from rover_pin.effects.grousers import Grousers
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.cause import SIZE_SD, reading_error

SIZE, SHAPE = "RateDependence.c_r", "RateDependence.v_0"
RATE = plain_candidate(RateDependence())


def test_a_cause_of_unknown_shape_has_it_within_a_decade():
    parameter, doubted = RATE.cause.parameters
    assert (parameter.name, parameter.prior) == (SIZE, True)
    assert (doubted.name, doubted.prior, doubted.log) == (SHAPE, True, True)
    assert [doubted.value(u) for u in (-2.0, -1.0, 0.0, 1.0, 2.0)] == pytest.approx([1e-4, 1e-3, 0.01, 0.1, 1.0])
    assert RATE.cause.amplitudes == {SIZE}


def test_a_size_is_neutral_at_none_and_two_defaults_at_one_sd():
    for effect in (RateDependence(), PostPeak(), Grousers()):
        candidate = plain_candidate(effect)
        for parameter in candidate.cause.parameters:
            if parameter.name in candidate.amplitudes:
                default = getattr(effect, parameter.name.rpartition(".")[2])
                neutral = effect.neutral[parameter.name.rpartition(".")[2]]
                assert parameter.value(0.0) == neutral
                assert parameter.value(1.0) == pytest.approx(neutral + SIZE_SD * (default - neutral))


def test_a_number_that_nobody_declares_gets_a_wide_prior():
    assumed = Parameter("soil.k", 1.0, 0.5, 0.0, 9.0, prior=False)
    assert proper(assumed) == replace(assumed, prior=True, scale=PRIOR_WIDENING * 0.5)
    declared = replace(assumed, prior=True)
    assert proper(declared) is declared


def test_an_error_of_the_measuring_adds_nothing_to_the_model():
    tare = Parameter("rig.torque_tare", 0.0, 0.1, -1.0, 1.0)
    cause, model = reading_error(tare.name, tare), object()
    assert cause.on(model) is model
    assert cause.amplitudes == {tare.name}
    assert (cause.family, cause.owner) == ("rig", "")
