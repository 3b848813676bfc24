"""What a controller believes: apart from the plant, learnt on the way, and stated."""

import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.contact import Soil, Wheel
from rover_pin.control.sensing.onboard_slip import SLIPS, OnboardSlip
from rover_pin.control.sensing.soil_belief import CERTAIN, BeliefSD, ControllerBelief, SoilHypotheses
from rover_pin.control.torque_factor import torque_factors
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import write_model as write_rig_model
from rover_pin.simulation.model.toml_file import write_model
from rover_pin.simulation.sensors import NoisyController, Sensors


def believed(control="onboard", **settings):
    drive = scenario("ditch", control=control, duration=0.1, **settings)
    return drive.controller.estimate.believed, drive


@pytest.mark.parametrize("control", ["onboard", "camera"])
def test_a_controller_knows_nothing_of_the_plant_s_soil(control):
    """The controllers of two plants have equal beliefs, although the sands differ and one plant has an effect more."""
    first, _ = believed(control, **{"soil.k": 0.003, "add": "DiggingMemory.c_d=0.1"})
    second, _ = believed(control, **{"soil.k": 0.04, "soil.phi_deg": 25.0, "effect.MotionResistance.R": 0.3})
    assert first.sd == second.sd != CERTAIN
    assert torque_factors(first.model, SLIPS) == pytest.approx(torque_factors(second.model, SLIPS), rel=1e-12)


def test_the_torque_check_knows_no_more_than_the_estimate():
    first, second = (believed(**{"soil.phi_deg": phi})[1].controller.controller.limit for phi in (25.0, 36.0))
    assert first == second


def test_a_plant_is_known_where_a_user_says_so():
    belief, drive = believed(**{"control.believes": "plant", "soil.k": 0.003})
    assert belief.model is drive.model
    assert belief.sd == CERTAIN
    assert len(drive.controller.estimate.soils.factors) == 1


def test_every_drive_states_its_belief():
    assert (
        believed(**{"control.believes": "table-1"})[1].assumed[-1]
        == believed(**{"control.believes": "table-1"})[0].sentence
    )
    for word, parts in (("unknown-sand", ("unknown-sand", "20 mm")), ("table-1", ("table-1", "50 mm", "30 deg"))):
        assert all(part in believed(**{"control.believes": word})[0].sentence for part in parts)
    assert not [line for line in scenario("ditch", control="true").assumed if "belief" in line]


def test_a_number_of_the_belief_can_be_set():
    belief, _ = believed(**{"control.believes": "table-1", "control.believes.k": 0.25})
    assert belief.sd == BeliefSD(k=0.25)
    with pytest.raises(ParameterError, match=r"control\.believes = 'tabl-1'.*table-1"):
        believed(**{"control.believes": "tabl-1"})
    with pytest.raises(DataError, match=r"nofile\.toml"):
        believed(**{"control.believes": "nofile.toml"})


def test_a_folder_of_models_is_a_belief_with_their_scatter(tmp_path):
    """The posterior of a loop: mean and scatter of ln k and of R come from its models."""
    ks, Rs = (0.004, 0.009, 0.02), (0.02, 0.05, 0.08)
    for at, (k, R) in enumerate(zip(ks, Rs, strict=True)):
        settings = {"soil": "table-1", "soil.k": k, "effect.MotionResistance.R": R}
        write_model(scenario("flat", **settings).model, tmp_path / f"{at}.toml")
    belief, _ = believed(**{"control.believes": str(tmp_path)})
    assert float(belief.model.soils[0].k) == pytest.approx(math.prod(ks) ** (1 / 3))
    assert float(belief.sd.k) == pytest.approx(np.std(np.log(ks)))
    assert float(belief.sd.resistance) == pytest.approx(np.std(Rs))
    alone, _ = believed(**{"control.believes": str(tmp_path / "1.toml")})
    assert float(alone.model.soils[0].k) == pytest.approx(0.009)
    assert alone.sd == BeliefSD()


def test_a_rig_s_model_is_a_belief_about_the_soil(tmp_path):
    """Soil and traction law come from the model of the rig; wheels, motors and gravity come from the rover."""
    soil = Soil(k=0.013)
    rig = RigModel(Wheel(), soil, (SoilTraction(),))
    belief, drive = believed(**{"control.believes": str(write_rig_model(rig, tmp_path / "rig.toml"))})
    assert belief.model.soils[0] == soil
    assert belief.model.rover is drive.model.rover
    assert belief.sd == BeliefSD()


def test_hypotheses_have_the_moments_of_the_belief():
    model = scenario("flat", soil="table-1", **{"soil.k": 0.01}).model
    soils = SoilHypotheses.of(model, BeliefSD(k=0.3, strength=0.0, torque=0.0), SLIPS)
    assert np.log(soils.softness).mean() == pytest.approx(0.0, abs=1e-12)
    assert np.log(soils.softness).std() == pytest.approx(0.3)
    strengths = SoilHypotheses.of(model, BeliefSD(k=0.0, strength=0.06, torque=0.08), SLIPS).factors[:, -1]
    assert np.log(strengths).std() == pytest.approx(0.1)


@pytest.mark.parametrize(("k", "soft"), [(0.004, False), (0.035, True)])
def test_the_soil_is_learnt_on_hills(k, soft):
    """On bent ground the posture shows the speed, so that torques tell a soft sand from a firm one."""
    plant = scenario("hills", soil="table-1", **{"soil.k": k}).model
    estimate = OnboardSlip.of(ControllerBelief.unknown_sand(plant))
    means = []

    class Watch(ConstantDuty):
        def __call__(self, reading):
            estimate.slip(reading)
            keep = estimate.belief.keep
            means.append(float(keep["p_soil"] @ np.log(keep["softness"])))
            return 0.55

    simulate(plant, NoisyController(Watch(), Sensors(), 3), 30.0, scenario("hills").start)
    late = np.mean(means[len(means) // 3 :])
    assert late > 0.2 if soft else late < 0.2
