"""Which numbers of a drive model are free, and which effects it may lack and where, on hand-made logs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.contact import Soil
from rover_pin.discrepancy.candidate import released_candidate
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.raw_current import RawCurrent
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.calibrate import raw_current_numbers, with_raw_currents
from rover_pin.experiments.drive_log.candidates import _places, candidate_of, candidates, sized, variants
from rover_pin.experiments.drive_log.parameters import owner_name, owners, parameter, with_record
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat

CART, WHEELS = load_rover("cart"), ("fl", "fr", "bl", "br")
MODEL = Model(CART, flat(), (Soil(), Soil(k=0.02)), Motor(), gravity=2.0)

# --- currents of which only the shape is known -----------------------------------------------------------------------


class Run(dict):
    """The channels of one run, whose wheels may be held to their rates."""

    def __init__(self, held=False, **channels):
        super().__init__({name: np.array(values, dtype=float) for name, values in channels.items()})
        self.rate_driven = held


def log_of(*runs, motor=()):
    return SimpleNamespace(metadata=SimpleNamespace(motor=dict.fromkeys(motor, 1.0), wheels=WHEELS), runs=runs)


def currents(log, model=MODEL):
    """What is called by what channel: motor, scale and zero at which it begins."""
    added = [one for one in with_raw_currents(log, model).sensor_effects if isinstance(one, RawCurrent)]
    return {one.channel: (one.motor, one.scale, one.offset) for one in added}


def test_counts_start_at_their_median_with_unknown_scale():
    runs = (Run(raw_current_fl=[500.0, np.nan, 540.0]), Run(raw_current_fl=[520.0, 900.0]), Run())
    assert currents(log_of(*runs)) == {"raw_current_fl": ("fl", 0.0, 530.0)}
    assert currents(log_of(Run(raw_current_fl=[np.nan, np.nan]))) == {}
    assert currents(log_of(Run())) == {}


def test_a_current_that_a_model_knows_is_left_as_it_is():
    log = log_of(Run(raw_current_fl=[3.0], raw_current_bl=[5.0], raw_current_fr=[7.0]))
    known = MODEL.having(RawCurrent(scale=2.0, offset=1.0, motor="fr", channel="raw_current_fr"))
    known = known.having(SensorBias(channel="raw_current_bl"))
    assert currents(log, known) == {
        "raw_current_fl": ("fl", 0.0, 3.0), "raw_current_bl": ("bl", 0.0, 5.0), "raw_current_fr": ("fr", 2.0, 1.0),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("motor", "held", "counts"),
    [
        ((), (True, True), True),
        (("k_t",), (True,), True),
        (("gear",), (True,), True),
        (("k_t", "gear"), (True,), False),
        (("k_t", "gear", "R"), (True,), False),
        ((), (True, False), True),
        ((), (False, False), False),
    ],
)
def test_amperes_are_counts_on_held_wheels_if_k_t_is_undeclared(motor, held, counts):
    log = log_of(*(Run(one, current_fl_A=[0.1, 0.3], raw_current_br=[9.0]) for one in held), motor=motor)
    assert ("current_fl_A" in currents(log)) == counts
    assert currents(log)["raw_current_br"] == ("br", 0.0, 9.0), "whatever is declared"


def test_raw_current_scale_prior_is_a_pull_of_3_percent_load():
    """SD of the counts over the current of 0.03 m g r / k_t of a wheel; the zero by three SDs."""
    values = np.array([512.0, 520.0, np.nan, 516.0, 530.0])
    log = log_of(Run(raw_current_fr=values[:3]), Run(raw_current_fr=values[3:]), Run(raw_current_fl=[4.0, 4.0]))
    still_scale, still_zero, scale, zero = raw_current_numbers(log, with_raw_currents(log, MODEL))
    spread = np.std(values[np.isfinite(values)])
    torque = 0.03 * (CART.mass * 2.0 / 4.0) * 0.11
    assert (scale.name, scale.origin) == ("RawCurrent[raw_current_fr].scale", 0.0)
    assert scale.scale == pytest.approx(spread * float(MODEL.motor.constant) / torque)
    assert (zero.name, zero.origin) == ("RawCurrent[raw_current_fr].offset", 518.0)
    assert zero.scale == pytest.approx(3.0 * spread)
    assert scale.prior
    assert zero.prior
    assert still_zero.scale == pytest.approx(3e-9), "a counter that stands"
    assert 0.0 < still_scale.scale < 1e-6


# --- records and their numbers ---------------------------------------------------------------------------------------


def test_soil_motor_and_effects_are_called_by_name_and_replaced():
    weak, bias = WeakMotor(g=0.1, wheel=2), SensorBias(channel="body_roll")
    assert [owner_name(each) for each in (weak, bias, TetherDrag())] == ["WeakMotor[2]", "SensorBias[body_roll]",
                                                                         "TetherDrag"]  # fmt: skip
    assert owner_name(TachoScale(wheel="")) == "TachoScale"
    model = MODEL.having(weak)
    assert owners(model)["soil"] is MODEL.soils[0]
    assert owners(model)["motor"] is MODEL.motor
    assert owners(model)["WeakMotor[2]"] is weak
    firm, strong = Soil(k_1=1e7), Motor().replace(gear=99.0)
    assert with_record(model, "soil", firm).soils == (firm, MODEL.soils[1])
    assert with_record(model, "motor", strong).motor is strong
    assert with_record(model, "WeakMotor[2]", weak.replace(g=0.2)).motor_effects == (weak.replace(g=0.2),)


@pytest.mark.parametrize("called", ["Drag", "adrag", "my_drag", "pull", "zdrag"])
def test_user_effect_is_replaced_whatever_its_class_name(called):
    drag = TetherDrag(f_0=0.25)
    assert drag in with_record(MODEL.having(TetherDrag()), called, drag).all_effects


def test_a_number_lies_about_its_present_value():
    one = parameter(MODEL, "soil.k", 0.2, log=True)
    about = (one.origin, one.scale, one.low, one.high, one.log, one.prior)
    assert about == (float(Soil().k), 0.2, one.low, one.high, True, True)
    plain = parameter(MODEL, "soil.k", 0.2, prior=False)
    assert (plain.log, plain.prior) == (False, False)


# --- what a model may lack -------------------------------------------------------------------------------------------


def experiment(*ways, channels=(), held=False):
    """Runs along these x [m]."""
    ways = ways or (np.array([0.0, 0.0]),)
    places = [np.column_stack([way, np.zeros((len(way), 2))]) for way in ways]
    runs = [SimpleNamespace(commands=SimpleNamespace(place=each, terrain=None)) for each in places]
    return SimpleNamespace(channels=channels, rate_driven=held, runs=runs)


def test_numbers_with_priors_are_candidates_except_soil_motor():
    log = log_of(Run(raw_current_fl=[1.0, 2.0]))
    model = with_raw_currents(log, MODEL).having(TachoScale(e=0.0, wheel="fl")).having(WeakMotor(g=0.0, wheel=1))
    free = [parameter(model, name, 0.01) for name in ("soil.phi", "motor.gear", "TachoScale[fl].e", "WeakMotor[1].g")]
    free += [parameter(model, "TachoScale[fl].e", 0.01, prior=False), *raw_current_numbers(log, model)]
    found = candidates(model, experiment(), free, None)
    assert [each.amplitudes for each in found if each.released] == [("TachoScale[fl].e",), ("WeakMotor[1].g",)]
    names = [each.name for each in found if not each.released]
    assert "TachoScale[fl]" not in names
    assert "TachoScale[fr]" in names
    assert "WeakMotor[1]" not in names
    assert "WeakMotor[0]" in names


@pytest.mark.parametrize(("e", "declared", "freed"), [(0.0, False, True), (0.2, False, False), (0.2, True, True)])
def test_what_is_assumed_to_be_something_is_not_missing(e, declared, freed):
    model = MODEL.having(TachoScale(e=e, wheel="fl"))
    known = replace(parameter(model, "TachoScale[fl].e", 0.01), declared=declared)
    assert any(each.released for each in candidates(model, experiment(), [known], None)) is freed


def test_freed_number_and_effect_are_named_by_their_place():
    known, scale = Parameter("TachoScale[fl].e", 0.0, 0.01, -1.0, 1.0), TachoScale(e=0.0, wheel="fl")
    one = released_candidate(known, owners(MODEL.having(scale)))
    assert (one.kind, one.place, one.amplitudes) == ("TachoScale", "fl", ("TachoScale[fl].e",))
    assert (one.effect, one.released) == (scale, known)
    patch = candidate_of(HardPatch(x_from=1.25))
    assert (patch.name, patch.place_searched) == ("HardPatch@1.250", True)
    assert patch.amplitudes == tuple(f"HardPatch.{name}" for name in HardPatch.neutral)
    assert patch.shapes == ("HardPatch.x_from", "HardPatch.length")
    drag = candidate_of(TetherDrag())
    assert (drag.kind, drag.place, drag.shapes) == ("TetherDrag", "", ()), "where it began and what rounds it off stay"


def test_a_compliance_is_tried_in_proportion_to_what_turns_it():
    """Per torque: less for a heavier rover with larger wheels."""
    turning = CART.mass / load_rover("nexus6").mass * 110.0 / 45.0 * 2.0 / 9.81
    usual = DifferentialCompliance(compliance=0.01, backlash=0.0)
    assert sized(usual, CART, 2.0).compliance == pytest.approx(0.01 / turning)
    assert sized(usual, CART, -2.0) == sized(usual, CART, 2.0)
    assert sized(TetherDrag(), CART, 1e6).f_0 == 1e3, "within its bounds"


def test_an_effect_is_tried_at_all_wheels_at_once_and_at_each():
    at = experiment(channels=("path", "body_pitch", "current_fl_A", "wheel_rate_fl", "bogie_l", "body_z"))
    assert [one.wheel for one in variants(TachoScale, MODEL, at)] == ["", *WHEELS]
    assert [one.wheel for one in variants(WeakMotor, MODEL, at)] == [0, 1, 2, 3]
    assert [one.channel for one in variants(SensorBias, MODEL, at)] == ["body_pitch", "current_fl_A", "bogie_l"]
    assert len(list(variants(TetherDrag, MODEL, at))) == 1
    patches = list(variants(HardPatch, MODEL, at))
    assert [one.x_from + 0.25 * one.length for one in patches] == pytest.approx([-0.1, 0.05])


def test_on_a_long_way_only_what_two_runs_have_passed_is_tried():
    """From 9 m on 60 places do not reach; a run that passes twice is one run."""
    once, again = np.r_[np.arange(0.0, 9.0, 0.01), np.arange(9.0, 0.0, -0.01)], np.array([5.0, 5.1, np.nan, 5.4])
    found = _places(experiment(once, again), 0.4)
    assert found == pytest.approx([-0.1 + 0.15 * at - 0.1 for at in (34, 36)])
    assert _places(experiment(once), 0.4) == []
    both = _places(experiment(once, once), 0.0)
    assert both == pytest.approx(-0.1 + 0.15 * np.arange(0, 61, 2)), "61 are too many: every other"
    most = _places(experiment(once, once[once > 0.1]), 0.0)
    assert most == pytest.approx(-0.1 + 0.15 * np.arange(1, 61))
    three = _places(experiment(once + 1e3, once + 1e3, once), 0.0)
    assert len(three) == 31
