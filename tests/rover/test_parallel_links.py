"""A parallel link as joints that follow: the loop closes, moves as a loop does, and both steps hold it."""

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, load_rover, scenario, simulate
from rover_pin.base.errors import UrdfError
from rover_pin.rover.forward_dynamics import constraint_rows, forward_dynamics, forward_dynamics_aba
from rover_pin.rover.urdf_check import check_urdf
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import Start, hovering

LINKS = load_rover("nexus6_links")
HALF, BARS = 0.075, 0.03
"""Half a bar and the distance of the two bars [m], in urdf/nexus6_links.urdf."""


def posture(rover, seed):
    """A configuration and a velocity that hold every constraint."""
    rng = np.random.default_rng(seed)
    step, v = rng.uniform(-0.5, 0.5, rover.model.nv), rng.normal(0.0, 1.0, rover.model.nv)
    for vector in (step, v):
        vector[rover.differential.right] = -vector[rover.differential.left]
        for coupling in rover.couplings:
            vector[coupling.follower] = coupling.ratio * vector[coupling.leader]
    return pin.integrate(rover.model, pin.neutral(rover.model), step), v, rng


@pytest.mark.parametrize("seed", range(4))
def test_the_ends_of_the_bars_meet_the_uprights(seed):
    q, _, _ = posture(LINKS, seed)
    data = LINKS.model.createData()
    pin.forwardKinematics(LINKS.model, data, q)
    place = {name: data.oMi[LINKS.model.getJointId(name)] for name in LINKS.model.names[1:]}
    for side in "lr":
        for end, along in (("m", HALF), ("r", -HALF)):
            lower = place[f"lower_{side}"].act(np.array([along, 0.0, 0.0]))
            upright = place[f"upright_{end}{side}"].act(np.array([0.0, 0.0, -BARS]))
            assert lower == pytest.approx(upright, abs=1e-14)
        turned = place[f"rocker_{side}"].rotation.T @ place[f"upright_m{side}"].rotation
        assert turned == pytest.approx(np.eye(3), abs=1e-14), "uprights do not turn with the bogie"


def gaps(rover, q):
    """The Jacobian of the distances between the lower bars' ends and the uprights [12, nv]."""
    model, data = rover.model, rover.model.createData()
    pin.computeJointJacobians(model, data, q)

    def moves(joint, point):
        at = model.getJointId(joint)
        J = pin.getJointJacobian(model, data, at, pin.LOCAL_WORLD_ALIGNED)
        return J[:3] - pin.skew(data.oMi[at].rotation @ np.array(point)) @ J[3:]

    ends = [(f"upright_{end}{side}", f"lower_{side}", x) for side in "lr" for end, x in (("m", HALF), ("r", -HALF))]
    return np.vstack([moves(bar, [x, 0.0, 0.0]) - moves(upright, [0.0, 0.0, -BARS]) for upright, bar, x in ends])


def closed_loop_acceleration(rover, q, v, torques):
    """The tree with its loops closed by points that stay together, no joint told to follow another."""
    model, data = rover.model, rover.model.createData()
    pin.computeAllTerms(model, data, q, v)
    H = np.triu(data.M) + np.triu(data.M, 1).T
    ahead, behind = (gaps(rover, pin.integrate(model, q, step * v)) for step in (1e-6, -1e-6))
    row = np.zeros((1, model.nv))
    row[0, [rover.differential.left, rover.differential.right]] = 1.0
    G, drift = np.vstack([row, gaps(rover, q)]), np.append(0.0, (ahead - behind) @ v / 2e-6)
    saddle = np.block([[H, G.T], [G, np.zeros((len(G), len(G)))]])
    return np.linalg.lstsq(saddle, np.concatenate([torques - data.nle, -drift]), rcond=1e-11)[0][: model.nv]


@pytest.mark.parametrize("seed", range(3))
def test_it_accelerates_as_the_closed_loop_does(seed):
    """Points that stay together (more than are needed) against joints that follow."""
    q, v, rng = posture(LINKS, seed)
    torques = rng.normal(size=LINKS.model.nv)
    fast = forward_dynamics(LINKS, q, v, torques, np.zeros((6, 6)))
    slow = forward_dynamics_aba(LINKS, q, v, torques, np.zeros((6, 6)))
    assert fast.a == pytest.approx(slow.a, abs=1e-9 * np.abs(fast.a).max())
    loop = closed_loop_acceleration(LINKS, q, v, torques)
    assert fast.a == pytest.approx(loop, abs=1e-5 * np.abs(loop).max())
    assert constraint_rows(LINKS) @ fast.a == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("route", [forward_dynamics, forward_dynamics_aba])
def test_what_is_violated_comes_back_each_at_its_own_place(route):
    """phi'' = -2 w phi' - w^2 phi for the differential and for each joint that follows, w = 20 1/s."""
    q, v, rng = posture(LINKS, 5)
    both, follow = LINKS.differential, LINKS.couplings
    q[both.q_left] += 0.02
    v[both.left] += 0.3
    for coupling in follow:
        q[coupling.q_follower] += rng.uniform(-0.02, 0.02)
        v[coupling.follower] += rng.uniform(-0.3, 0.3)
    a = route(LINKS, q, v, rng.normal(size=LINKS.model.nv), np.zeros((6, 6))).a
    parts = [(both.left, both.right, both.q_left, both.q_right, -1.0)]
    parts += [
        (coupling.follower, coupling.leader, coupling.q_follower, coupling.q_leader, coupling.ratio)
        for coupling in follow
    ]
    for i, j, q_i, q_j, ratio in parts:
        wanted = -40.0 * (v[i] - ratio * v[j]) - 400.0 * (q[q_i] - ratio * q[q_j])
        assert a[i] - ratio * a[j] == pytest.approx(wanted, rel=1e-8), (i, j)


def test_differential_torque_closes_equation_8_at_a_rocker():
    """No other constraint acts on a rocker's row; without a differential there is none, though others hold."""
    q, v, rng = posture(LINKS, 6)
    torques, none = rng.normal(size=LINKS.model.nv), np.zeros((6, 6))
    dynamics = forward_dynamics(LINKS, q, v, torques, none)
    lacks = pin.rnea(LINKS.model, LINKS.model.createData(), q, v, dynamics.a) - torques
    assert dynamics.differential_torque == pytest.approx(lacks[LINKS.differential.left], rel=1e-8)
    assert dynamics.differential_torque == pytest.approx(lacks[LINKS.differential.right], rel=1e-8)
    assert abs(dynamics.differential_torque) > 0.01
    for loose in (dataclasses.replace(LINKS, differential=None), load_rover("cart")):
        state = pin.neutral(loose.model), np.zeros(loose.model.nv), np.ones(loose.model.nv)
        for route in (forward_dynamics, forward_dynamics_aba):
            assert route(loose, *state, np.zeros((len(loose.wheels), 6))).differential_torque == 0.0


def test_compiled_and_plain_step_agree_and_hold_the_links():
    model = scenario("one-sided-bump", rover="nexus6_links").model
    states = [hovering(model, Start(x=0.35)) for _ in range(2)]
    steppers = [kind(model, state, 0.005, False) for kind, state in zip((Kernel, PlainStepper), states, strict=True)]
    for _ in range(60):
        for stepper in steppers:
            stepper.duty[:] = 0.55
            assert stepper.step() == 0
    assert states[0].v == pytest.approx(states[1].v, abs=1e-9)
    assert steppers[0].energy == pytest.approx(steppers[1].energy, abs=1e-10)
    for coupling in LINKS.couplings:
        assert states[0].q[coupling.q_follower] == pytest.approx(
            coupling.ratio * states[0].q[coupling.q_leader], abs=1e-12
        )


def test_a_drive_with_parallel_links_keeps_its_energy():
    trace = simulate(scenario("bump", rover="nexus6_links", **{"terrain.ground": 1}).model, ConstantDuty(0.55), 12.0)
    assert np.abs(trace["bogie_l"]).max() > 0.15
    assert trace["upright_m_l"] == pytest.approx(-trace["bogie_l"], abs=1e-12)
    assert trace.energy_error() < 1e-5


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('joint="bogie_l" multiplier="1"', 'joint="steer_fl" multiplier="1"', "name 'steer_fl' in the TOML's"),
        (
            'joint="bogie_l" multiplier="1" offset="0"',
            'joint="bogie_l" multiplier="1" offset="0.1"',
            "offset 0.1; a joint that",
        ),
        ('joint="bogie_l" multiplier="1"', 'joint="bogie_l" multiplier="0"', "multiplier 0"),
    ],
)
def test_joints_that_cannot_follow_get_a_sentence(tmp_path, old, new, words):
    from rover_pin.rover.description.layout import shipped_toml

    toml = shipped_toml("nexus6_links")
    text = toml.with_suffix(".urdf").read_text()
    assert old in text
    (tmp_path / "nexus6_links.urdf").write_text(text.replace(old, new, 1))
    path = tmp_path / "mine.toml"
    path.write_text(toml.read_text())
    assert any(re.search(words, sentence) for sentence in check_urdf(path).faults)
    with pytest.raises(UrdfError, match=words):
        load_rover(path)
