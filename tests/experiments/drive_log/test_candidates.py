"""What is tried on a drive log: numbers that are free, effects that the rover can have, and nothing that it cannot."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Model, Motor, Soil, load_rover
from rover_pin.base.errors import ParameterError
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.experiments.drive_log import candidates as proposals
from rover_pin.experiments.drive_log.calibrate import raw_current_numbers, with_raw_currents
from rover_pin.experiments.drive_log.candidates import _places, candidate_of, candidates, scale_effect
from rover_pin.experiments.drive_log.experiment import neighbours
from rover_pin.experiments.drive_log.model import parameter
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.model.effect_files import known_effects
from rover_pin.terrain.shapes import flat

BENCH = SimpleNamespace(
    channels=(),
    rate_driven=False,
    runs=[SimpleNamespace(commands=SimpleNamespace(place=np.zeros((2, 3)), terrain=None))],
)
OWN = """
from dataclasses import dataclass
from rover_pin.effects.differential_compliance import DifferentialCompliance
@dataclass(frozen=True)
class MyGears(DifferentialCompliance):
    "Mine."
"""


def model(name):
    return Model(load_rover(name), flat(), (Soil(),), Motor())


def tried(name, effects_file=None):
    return {candidate.kind: candidate for candidate in candidates(model(name), BENCH, (), known_effects(effects_file))}


def test_every_candidate_can_be_added_to_the_rover():
    for name in ("nexus6", "cart"):
        rover_model = model(name)
        assert all(
            candidate.effect in candidate.on(rover_model).all_effects
            for candidate in candidates(rover_model, BENCH, (), known_effects())
        )


def driven(along, terrain=None):
    """A bench with one run that went to these x, perhaps on a ground of its own."""
    place = np.array([[x, 0.0, 0.0] for x in along])
    run = SimpleNamespace(commands=SimpleNamespace(place=place, terrain=terrain))
    return SimpleNamespace(channels=(), rate_driven=False, runs=[run])


def test_a_bent_ground_has_knots_along_all_that_wheels_passed():
    way = [0.3, -0.4, np.nan, 1.6]
    (bent,) = (
        candidate
        for candidate in candidates(model("nexus6"), driven(way), (), known_effects())
        if candidate.kind == "BentGround"
    )
    begin, length = float(bent.effect.x_from), float(bent.effect.length)
    ahead = np.ptp([place[0] for place in wheel_places(load_rover()).values()]) / 2
    assert begin + length * np.arange(1, 6) / 6 == pytest.approx(np.linspace(-0.4 - ahead, 1.6 + ahead, 5))
    assert (bent.name, len(bent.amplitudes), bent.shapes) == ("BentGround", 5, ())
    assert not neighbours(bent, 0.1), "its place is not sought"
    for bench in (driven([0.0, 0.1]), driven(way, flat())):
        assert "BentGround" not in {
            candidate.kind for candidate in candidates(model("nexus6"), bench, (), known_effects())
        }


def test_a_bent_ground_reaches_as_far_as_the_farthest_wheel(monkeypatch):
    """Of a rover whose base is over its back axle, which drives both ways."""
    xs = np.array([0.5, -0.1])
    monkeypatch.setattr(proposals, "corners", lambda rover: np.stack([np.array([[x, 0.2], [x, -0.2]]) for x in xs]))
    (bent,) = (
        candidate
        for candidate in candidates(model("nexus6"), driven([0.0, 1.0]), (), known_effects())
        if candidate.kind == "BentGround"
    )
    assert bent.effect.x_from + bent.effect.length / 6 == pytest.approx(-0.5)


def test_differential_and_pivot_effects_need_these_parts(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    parts = {"DifferentialCompliance", "PivotFriction", "SpringDamper", "MyGears"}
    nexus6, cart = tried("nexus6", tmp_path / "mine.py"), tried("cart", tmp_path / "mine.py")
    assert nexus6.keys() - cart.keys() == parts
    assert cart.keys() < nexus6.keys()


def test_the_model_says_why_an_effect_cannot_act():
    cart = model("cart")
    assert "DifferentialCompliance" in cart.refusal(DifferentialCompliance())
    assert re.search("PivotFriction.*'cart'", cart.refusal(PivotFriction()))
    assert "'ml'" in cart.refusal(TachoScale(wheel="ml"))
    assert "wheel 4" in cart.refusal(WeakMotor(wheel=4))
    assert not cart.refusal(DifferentialCompliance(compliance=0.0, backlash=0.0))
    for effect in (PivotFriction(), WeakMotor(wheel=4)):
        assert not model("nexus6").refusal(effect)
        with pytest.raises(ParameterError):
            cart.having(effect)


def test_forces_torques_and_masses_are_tried_in_rover_proportion():
    """A cable of 0.2 N/m behind a rover of 60 kg moved no row by 0.3 SD in all: it was never looked at."""
    cart, nexus = load_rover("cart"), load_rover("nexus6")
    weight, length = cart.mass / nexus.mass, 110.0 / 45.0
    drag = scale_effect(TetherDrag(), cart, 9.81)
    assert (drag.f_0, drag.f_1) == pytest.approx((0.5 * weight, 0.2 * weight / length))
    assert scale_effect(TetherDrag(), cart, 1.62).f_0 == pytest.approx(0.5 * weight * 1.62 / 9.81)
    assert scale_effect(PointMass(), cart, 1.62).m == pytest.approx(0.2 * weight)
    assert scale_effect(PivotFriction(), cart, 9.81).tau_c == pytest.approx(0.03 * weight * length)
    assert scale_effect(TetherDrag(), nexus, 9.81) == TetherDrag()
    assert scale_effect(TachoScale(e=0.02), cart, 9.81) == TachoScale(e=0.02)
    size = candidate_of(drag).size("TetherDrag.f_1")
    assert size.value(1.0) == pytest.approx(drag.f_1)


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


# --- what a model may lack -------------------------------------------------------------------------------------------


def experiment(*ways, channels=(), is_held=False):
    """Runs along these x [m]."""
    ways = ways or (np.array([0.0, 0.0]),)
    places = [np.column_stack([way, np.zeros((len(way), 2))]) for way in ways]
    runs = [SimpleNamespace(commands=SimpleNamespace(place=place, terrain=None)) for place in places]
    return SimpleNamespace(channels=channels, rate_driven=is_held, runs=runs)


def test_numbers_with_priors_are_candidates_except_soil_motor():
    log = log_of(Run(raw_current_fl=[1.0, 2.0]))
    model = with_raw_currents(log, MODEL).having(TachoScale(e=0.0, wheel="fl")).having(WeakMotor(g=0.0, wheel=1))
    free = [parameter(model, name, 0.01) for name in ("soil.phi", "motor.gear", "TachoScale[fl].e", "WeakMotor[1].g")]
    free += [replace(parameter(model, "TachoScale[fl].e", 0.01), prior=False), *raw_current_numbers(log, model)]
    candidate_list = candidates(model, experiment(), free, known_effects())
    assert [candidate.amplitudes for candidate in candidate_list if candidate.released] == [
        ("TachoScale[fl].e",),
        ("WeakMotor[1].g",),
    ]
    names = [candidate.name for candidate in candidate_list if not candidate.released]
    assert "TachoScale[fl]" not in names
    assert "TachoScale[fr]" in names
    assert "WeakMotor[1]" not in names
    assert "WeakMotor[0]" in names


@pytest.mark.parametrize(("e", "declared", "freed"), [(0.0, False, True), (0.2, False, False), (0.2, True, True)])
def test_what_is_assumed_to_be_something_is_not_missing(e, declared, freed):
    model = MODEL.having(TachoScale(e=e, wheel="fl"))
    is_known = replace(parameter(model, "TachoScale[fl].e", 0.01), declared=declared)
    assert (
        any(candidate.released for candidate in candidates(model, experiment(), [is_known], known_effects())) is freed
    )


def test_on_a_long_way_only_what_two_runs_have_passed_is_tried():
    """From 9 m on 60 places do not reach; a run that passes twice is one run."""
    once, again = np.r_[np.arange(0.0, 9.0, 0.01), np.arange(9.0, 0.0, -0.01)], np.array([5.0, 5.1, np.nan, 5.4])
    places = _places(experiment(once, again), 0.4)
    assert places == pytest.approx([-0.1 + 0.15 * at - 0.1 for at in (34, 36)])
    assert _places(experiment(once), 0.4) == []
    both = _places(experiment(once, once), 0.0)
    assert both == pytest.approx(-0.1 + 0.15 * np.arange(0, 61, 2)), "61 are too many: every other"
    most = _places(experiment(once, once[once > 0.1]), 0.0)
    assert most == pytest.approx(-0.1 + 0.15 * np.arange(1, 61))
    three = _places(experiment(once + 1e3, once + 1e3, once), 0.0)
    assert len(three) == 31
