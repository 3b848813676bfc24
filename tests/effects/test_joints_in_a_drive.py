"""Friction, compliance and springs in the suspension: levels and torques by hand, energy only taken or held."""

import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, load_rover, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.effect import Body
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.forward_dynamics import mass_matrix
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.start import Start, hovering, settled_state
from rover_pin.simulation.state import suspension_dofs
from rover_pin.simulation.stepping.timing import Timing


def test_the_level_by_hand():
    rates = (0.5, -0.5, 0.02, 0.0)
    body = Body(*[0.0] * 12, (0.0,) * 4, rates, rates)
    torques = [float(joint) for joint in PivotFriction(tau_c=0.03, b=0.01, w_s=0.02).push(body).joints]
    assert torques == pytest.approx([-0.035, 0.035, -0.03 * math.tanh(1.0) - 0.0002, 0.0], rel=1e-9)


def falling(model, seconds):
    """A rover in free fall whose bogie is hit: no gravity on the joints, no ground."""
    state = hovering(model, Start())
    state.q[2] += 50.0
    state.v[model.rover.mirror.perm[7]] = state.v[7] = 1.0
    kernel = Kernel(model, state, 0.005, symmetric=False)
    rates = []
    for _ in range(round(seconds / 0.005)):
        assert kernel.step() == 0
        rates.append(abs(state.v[7]))
    return np.array(rates), kernel.energy[-1], state


def test_a_bogie_that_was_hit_comes_to_rest_and_stays():
    """Without friction it goes on turning, up to its stop; with it the rate only falls, however short the step."""
    flat = scenario("flat").model
    free, nothing, _ = falling(flat, 0.3)
    angle, taken, state = falling(flat.having(PivotFriction(tau_c=0.5, b=0.0)), 0.3)
    assert free[-1] > 0.5
    assert nothing == 0.0
    assert angle[-1] < 1e-3
    assert np.all(np.diff(angle) <= 1e-5)
    assert 0.0 < taken < 0.5
    assert abs(state.q[8]) < 0.05


def test_it_takes_energy_over_a_bump_and_lags_the_bogie():
    model = scenario("one-sided-bump").model
    free, rubbing = (
        simulate(model_built, ConstantDuty(0.55), 12.0)
        for model_built in (model, model.having(PivotFriction(tau_c=0.1)))
    )
    assert np.all(np.diff(rubbing["energy_body"]) >= -1e-12)
    assert rubbing["energy_body"][-1] > 1e-3
    assert np.abs(rubbing["bogie_r"]).max() < np.abs(free["bogie_r"]).max()


BUMP = scenario("one-sided-bump").model


def drive(effect):
    return simulate(BUMP.having(effect), ConstantDuty(0.55), 12.0)


def torque(effect, twist, rate=0.0):
    body = Body(*[0.0] * 12, (twist, 0.0), (rate, 0.0), (rate, 0.0), twist, rate)
    return float(effect.push(body).differential)


@pytest.mark.parametrize(
    ("twist", "expected"), [(0.004, 0.0), (-0.0049, 0.0), (0.006, -0.2), (-0.015, 2.0), (0.0, 0.0)]
)
def test_the_torque_by_hand(twist, expected):
    assert torque(DifferentialCompliance(compliance=0.005, backlash=0.01), twist) == pytest.approx(expected, abs=1e-12)
    assert torque(DifferentialCompliance(compliance=0.005, backlash=0.01), 0.004, rate=3.0) == 0.0


def test_soft_differential_tends_to_the_rigid_one():
    rigid = drive(DifferentialCompliance(compliance=0.0, backlash=0.0))
    off = []
    for compliance in (1e-2, 1e-3, 1e-4, 1e-5):
        trace = drive(DifferentialCompliance(compliance=compliance, backlash=0.0))
        off.append(np.abs(trace["rocker_l"] - rigid["rocker_l"]).max())
        late = trace["t_s"] > 1.0
        assert trace["differential_torque"][late] == pytest.approx(
            rigid["differential_torque"][late], abs=40 * compliance + 1e-3
        )
    assert off[0] < 1e-3
    assert np.divide(off[1:], off[:-1]) == pytest.approx(0.1, rel=0.2)
    without = simulate(BUMP, ConstantDuty(0.55), 12.0)
    assert all(np.array_equal(rigid[name], without[name]) for name in without.channels)


def test_the_twist_is_the_compliance_times_the_torque():
    """Where it does not change by more than 1 mrad/s: its damping adds T_d = 10 ms of the rate."""
    trace = drive(DifferentialCompliance(compliance=0.02, backlash=0.0))
    twist = trace["rocker_l"] + trace["rocker_r"]
    steady = (trace["t_s"] > 0.5) & (np.abs(np.gradient(twist, trace["t_s"])) < 1e-3)
    assert steady.mean() > 0.8
    assert twist[steady] == pytest.approx(-0.02 * trace["differential_torque"][steady], abs=2e-5)


def test_within_the_play_the_rockers_are_free():
    """Torque only at the ends of the play, which the twist passes by no more than the stiffness allows.

    Set down, it swings into an end within .2 s: by 2 mrad too far in steps of 17 ms.
    """
    model = BUMP.having(DifferentialCompliance(compliance=0.001, backlash=0.03))
    trace = simulate(model, ConstantDuty(0.55), 12.0, timing=Timing(dt=0.005))
    twist = trace["rocker_l"] + trace["rocker_r"]
    inside = np.abs(twist) < 0.0149
    assert inside.any()
    assert np.abs(trace["differential_torque"][inside]).max() < 1e-12
    assert np.abs(twist).max() > 0.0149
    assert np.abs(twist).max() < 0.015 + 0.001


def test_play_lets_the_body_pitch_by_half_of_it():
    """Standing, the base leans on one end of the play: both rockers turn alike, by a quarter of the backlash each."""
    model = scenario("flat").model.having(DifferentialCompliance(compliance=0.0, backlash=0.04))
    from rover_pin.simulation.start import Start, settled_state

    q, differential = settled_state(model, Start()).q, model.rover.differential
    angles = q[[differential.q_left, differential.q_right]]
    assert np.abs(angles) == pytest.approx(0.01, abs=1e-3)


NAMES = ("rocker_l", "bogie_l", "rocker_r", "bogie_r")
FLAT = scenario("flat").model


@pytest.mark.parametrize(
    ("joint", "meant"),
    [("", (1, 1, 1, 1)), ("bogie", (0, 1, 0, 1)), ("rocker_r", (0, 0, 1, 0)), ("bogie_l", (0, 1, 0, 0))],
)
def test_torque_and_energy_by_hand(joint, meant):
    angles, rates = (0.1, -0.2, -0.1, 0.3), (0.5, 0.0, -0.5, 1.0)
    body = Body(*[0.0] * 12, angles, rates, rates, names=NAMES)
    spring = SpringDamper(k_s=2.0, d=0.1, q_0=0.05, joint=joint)
    torques = np.array([-0.15, 0.5, 0.35, -0.6]) * meant
    assert [float(joint) for joint in spring.push(body).joints] == pytest.approx(torques)
    assert float(spring.stored_energy(body)) == pytest.approx(np.dot(meant, [0.0025, 0.0625, 0.0225, 0.0625]))


def in_free_fall(effect, angle, seconds, kind=Kernel, dt=0.002):
    """A bogie let go at an angle, no ground and no gravity on the joints: its angle over time, and the stepper."""
    model = FLAT.having(effect)
    state = hovering(model, Start())
    state.q[2] += 50.0
    place = model.rover.angles["bogie_l"]
    state.q[place] = angle
    stepper = kind(model, state, dt, False)
    angles = [angle]
    for _ in range(round(seconds / dt)):
        assert stepper.step() == 0
        angles.append(float(state.q[place]))
    return np.array(angles), stepper


def test_a_bogie_rings_at_the_rate_of_its_spring_and_inertia():
    """omega = sqrt(k_s / I), I the inertia that the rest of the rover, free to move, leaves to this joint."""
    rover, k_s = load_rover(), 20.0
    angles, _ = in_free_fall(SpringDamper(k_s=k_s, d=0.0, joint="bogie_l"), 0.02, 1.0, dt=0.0005)
    H = mass_matrix(rover, hovering(FLAT, Start()).q)
    for wheel in rover.wheels:
        H[wheel.dof, wheel.dof] += float(FLAT.motor.armature)
    steered = [wheel.steer_dof for wheel in rover.wheels if wheel.steer_dof is not None]
    free = [i for i in range(rover.model.nv) if i not in steered]
    G = np.zeros((1, len(free)))
    G[0, [free.index(rover.differential.left), free.index(rover.differential.right)]] = 1.0
    saddle = np.block([[H[np.ix_(free, free)], G.T], [G, np.zeros((1, 1))]])
    bogie = free.index(next(i for i in suspension_dofs(rover) if rover.model.names[2:][i - 6] == "bogie_l"))
    answer = np.linalg.solve(saddle, np.eye(len(saddle))[bogie])[bogie]
    crossings = np.flatnonzero(np.diff(np.sign(angles)))
    measured = math.pi * (len(crossings) - 1) / (0.0005 * (crossings[-1] - crossings[0]))
    assert measured == pytest.approx(math.sqrt(k_s * answer), rel=0.02)


def test_preload_moves_load_from_the_middle_to_the_rear_wheel():
    """(N_m - N_r) a changes by the torque on the bogie, a = 75 mm being half of its length (urdf/nexus6.urdf)."""

    def middle_less_rear(effect):
        model = FLAT.having(effect)
        state = settled_state(model, Start())
        kernel = Kernel(model, state, 1e-3, True)
        kernel.step()
        normal = kernel.record[:, 3]
        return normal[2] - normal[4], float(state.q[model.rover.angles["bogie_l"]])

    free, _ = middle_less_rear(SpringDamper(k_s=0.0, d=0.0))
    bent, angle = middle_less_rear(SpringDamper(k_s=0.5, d=0.0, q_0=0.2, joint="bogie"))
    torque = 0.5 * (0.2 - angle)
    assert torque > 0.05
    assert (bent - free) * 0.075 == pytest.approx(torque, rel=0.03)


@pytest.fixture(scope="module")
def over_a_hard_bump():
    """Drives over a bump under the left wheels: without, with soft and with stiff springs."""
    bump = scenario("one-sided-bump", **{"terrain.ground": 1}).model
    springs = {"none": (), "soft": (SpringDamper(),), "stiff": (SpringDamper(k_s=100.0, joint="bogie"),)}
    models = {name: bump.replace(body_effects=effects) for name, effects in springs.items()}
    return {name: simulate(model, ConstantDuty(0.55), 24.0) for name, model in models.items()}


def test_energy_is_held_and_given_back_and_never_made(over_a_hard_bump):
    """The bump bends the springs, they are straight again behind it, and what dampers take only grows."""
    trace = over_a_hard_bump["soft"]
    stored, lost = trace["energy_elastic"], trace["energy_body"] - trace["energy_elastic"]
    assert stored.max() > 0.05
    assert stored[-1] < 1e-3
    assert np.all(np.diff(lost) >= -1e-12)
    assert lost[-1] > 0.01
    assert trace.energy_error() < 1e-5
    assert trace.unit("energy_elastic") == "J"
    assert "energy_elastic" not in over_a_hard_bump["none"]


def test_a_joint_that_is_not_there_is_refused():
    with pytest.raises(ParameterError, match=r"'boggie': .*bogie"):
        FLAT.having(SpringDamper(joint="boggie"))
