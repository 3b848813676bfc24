"""`simulate` is compared with a second simulator that shares no code with it: other bodies, contact, quadrature and
integrator.

The remaining differences come from the discretised rim (721 points, cells cut linearly at a bisector), from the
package's quadrature with 12 nodes, and from the steps. Over 3 to 12 s they were measured to be below 0.015 mm and 0.04
mrad on every terrain.
"""

import ast
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Command
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.start import Start, settled_state

HERE = Path(__file__).parents[1] / "oracle" / "independent"
URDF = Path(__file__).parents[2] / "urdf" / "nexus6.urdf"
_spec = importlib.util.spec_from_file_location("independent", HERE / "__init__.py")
sys.modules["independent"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(sys.modules["independent"])
physics, rest, drive = (importlib.import_module(f"independent.{name}") for name in ("physics", "rest", "drive"))

STEP, FINE = 0.0025, Timing(0.00125)
PLACE, ANGLE, RATE, SLIP, FORCE = 5e-5, 1e-4, 3e-3, 1e-2, 0.1
"""m, rad, rad/s, -, N. Slips and forces are told half a step apart, and jump where a piece of ground ends."""
STRAIGHT = np.zeros(4)
BEND = np.array([0.3, 0.3, -0.3, -0.3])
PHASES = np.array([0.0, 0.7, 1.3, 2.0, 2.9, 4.0])


def twin(model):
    """Return the second simulator with the numbers of this model."""
    soil = {name: float(getattr(model.soils[0], name)) for name in physics.soils.Soil.__dataclass_fields__}
    motor, terrain = model.motor, model.terrain
    return physics.Physics(
        physics.World(
            str(URDF),
            physics.Motor(motor.supply, motor.resistance, motor.constant, motor.armature),
            physics.Ground([(profile.x, profile.z) for profile in terrain.profiles], terrain.borders),
            physics.soils.Soil(**soil),
            resistance=float(model.effect(MotionResistance).R),
            gravity=model.gravity,
        )
    )


def converted(second, model, state):
    """Return a state of the package as the state vector of the second simulator."""
    joints = [model.rover.model.joints[model.rover.model.getJointId(name)] for name in second.tree.names]
    angles = [
        state.q[at.idx_q] if at.nq == 1 else np.arctan2(state.q[at.idx_q + 1], state.q[at.idx_q]) for at in joints
    ]
    x, y, z, w = state.q[3:7]
    return np.concatenate([state.q[:3], [w, x, y, z], angles, np.zeros(6 + len(angles)), *state.contact.T])


def both(model, command, duration, start=Start()):
    """Drive both simulators from the package's state at rest."""
    independent, state = twin(model), settled_state(model, start)
    theirs = simulate(model, lambda reading: Command(*command(reading.t)), duration, state.copy(), FINE)
    return drive.drive(independent, converted(independent, model, state), command, duration, STEP), theirs


def assert_agreement(mine, theirs):
    for i, axis in enumerate("xyz"):
        assert mine["place"][:, i] == pytest.approx(theirs[f"body_{axis}"], abs=PLACE)
        assert mine["velocity"][:, i] == pytest.approx(theirs[f"body_v{axis}"], abs=RATE)
    for name in ("roll", "pitch", "yaw"):
        assert mine[name] == pytest.approx(theirs[f"body_{name}"], abs=ANGLE)
    assert mine["wheel_rate"] == pytest.approx(theirs.stack("wheel_rate"), abs=RATE)
    assert mine["slip"] == pytest.approx(theirs.stack("slip"), abs=SLIP)
    for name in ("normal", "tangential", "lateral"):
        assert mine[name] == pytest.approx(theirs.stack(name), abs=FORCE)
    assert mine["sinkage"] == pytest.approx(theirs.stack("sinkage"), abs=3e-4)


def uneven(t):
    return 0.5 + 0.15 * np.sin(2.0 * t + PHASES), STRAIGHT


def there_and_back(t):
    return np.full(6, 0.55 if t < 0.55 else -0.55), STRAIGHT


def bending(t):
    return np.full(6, 0.7), BEND * min(2.0 * t, 1.0)


def onwards(t):
    return np.full(6, 0.9), STRAIGHT


SAND = {"soil.k": 0.01}
SLOPE = {**SAND, "terrain.start": -3.0, "terrain.angle_deg": 8.0}


def test_it_shares_no_code():
    for file in HERE.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [name.name for name in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith(("rover_pin", "pinocchio", "casadi")) for name in names)


def test_statics_find_the_same_rest():
    model = scenario("flat").model
    independent, state = twin(model), settled_state(model, Start())
    mine, theirs = independent.unpack(rest.rest(independent)), independent.unpack(converted(independent, model, state))
    assert mine.place[2] == pytest.approx(theirs.place[2], abs=1e-6)
    assert mine.quaternion == pytest.approx(theirs.quaternion, abs=1e-6)
    hinges = np.delete(np.arange(len(mine.angles)), independent.wheel_angle)
    assert mine.angles[hinges] == pytest.approx(theirs.angles[hinges], abs=1e-5)
    assert mine.along == pytest.approx(theirs.along, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings", "command", "duration", "start"),
    [
        ("flat", {}, uneven, 1.2, Start()),
        ("flat", {}, there_and_back, 1.2, Start()),
        ("incline", SLOPE, bending, 1.2, Start(yaw=0.5)),
        ("ditch", {**SAND, "terrain.at": 0.17}, onwards, 2.0, Start()),
        pytest.param("turn", {"side": "shear"}, bending, 6.0, Start(), marks=pytest.mark.slow),
        pytest.param("one-sided-bump", {**SAND, "terrain.at": 0.2}, onwards, 8.0, Start(), marks=pytest.mark.slow),
        pytest.param("ditch", {**SAND, "terrain.at": 0.2}, onwards, 12.0, Start(), marks=pytest.mark.slow),
    ],
    ids=["uneven", "reversal", "bend on a slope", "into a ditch", "turn", "bump on one side", "through a ditch"],
)
def test_both_simulators_drive_alike(name, settings, command, duration, start):
    assert_agreement(*both(scenario(name, **settings).model, command, duration, start))
