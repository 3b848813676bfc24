"""The compiled step against the plain one, which shares neither geometry code nor linear algebra with it."""

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.body import shapes
from rover_pin.body.acceleration import constraint_rows
from rover_pin.body.rover import load_rover
from rover_pin.contact import Soil
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.motion.kernel import DIRECTION_SPEED, Kernel
from rover_pin.motion.model import Model, base_effects
from rover_pin.motion.motor import Motor
from rover_pin.motion.native.shared import RECORD
from rover_pin.motion.place import Start, settled
from rover_pin.motion.plain import Plain
from rover_pin.parameters.hard import HARD_GROUND
from rover_pin.scenarios import scenario
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.traction import NetTraction

ROVER = load_rover()
GRIPPY = Soil(k=0.004)


def model(terrain, slip, traction=SoilTraction(), soil=GRIPPY, rover=ROVER):
    made = Model(rover, terrain, (soil, HARD_GROUND), Motor(), slip, base_effects(soil, rover, traction))
    return made.having(GearFriction(tau_c=0.02))


def narrow_in_front(rover):
    """The rover with front wheels of half the width."""
    front = max(mount.axle for mount in rover.wheels)
    narrow = rover.wheel.replace(b=rover.wheel.b / 2)
    mounts = (dataclasses.replace(each, wheel=narrow) if each.axle == front else each for each in rover.wheels)
    return dataclasses.replace(rover, wheels=tuple(mounts))


CASES = {
    "ditch": (model(shapes.ditch(wall_angle=math.radians(45.0), at=0.25), RelaxedSlip()), Start()),
    "rocks": (model(shapes.rocks(seed=3), RelaxedSlip()), Start()),
    "yawed": (model(shapes.ditch(wall_angle=math.radians(40.0), at=0.3), RelaxedSlip()), Start(yaw=0.6)),
    "backwards": (model(shapes.step(0.02, at=0.3), RelaxedSlip()), Start(x=0.6, yaw=math.pi)),
    "hills": (model(shapes.hills(1), RelaxedSlip()), Start(y=0.3, yaw=1.0)),
    "eq-1": (model(shapes.bump(at=0.2, ground=1), AlgebraicSlip()), Start()),
    "net": (model(shapes.flat(), RelaxedSlip(), SoilTraction(NetTraction(), SinkageAngles())), Start()),
    "over-an-edge": (model(shapes.rocks(seed=3), RelaxedSlip()), Start(y=0.135)),
    "across-an-edge": (model(shapes.one_sided_bump(at=-0.5, length=3.0), RelaxedSlip()), Start(y=-0.4, yaw=1.3)),
    "stiff-motor": (
        dataclasses.replace(model(shapes.bump(at=0.2), RelaxedSlip()), motor=Motor(resistance=0.5, rotor_inertia=3e-9)),
        Start(),
    ),
    "astride-an-edge": (model(shapes.one_sided_bump(0.01, 6.0, -3.0), RelaxedSlip()), Start(y=0.155, yaw=0.02)),
    "light": (dataclasses.replace(model(shapes.bump(0.01, at=0.05), AlgebraicSlip()), gravity=0.02), Start()),
    "held": (model(shapes.incline(math.radians(6.0), -2.0), RelaxedSlip()), Start()),
    "held, eq-1": (model(shapes.cross_slope(math.radians(9.0)), AlgebraicSlip(v_0=0.02)), Start(yaw=0.7)),
    "sprung, in its ruts": (
        model(shapes.step(0.02, at=0.3), RelaxedSlip())
        .having(MultiPass())
        .having(DiggingMemory(c_d=0.05))
        .having(SupplySag())
        .having(SpringDamper(k_s=0.6, d=0.02, q_0=0.1))
        .having(TetherDrag()),
        Start(x=0.6, yaw=math.pi),
    ),
    "stalled in its holes": (
        model(shapes.incline(math.radians(9.0), -2.0), RelaxedSlip(), soil=Soil())
        .having(DiggingMemory(c_d=0.3))
        .having(Bulldozing()),
        Start(),
    ),
    "compliant": (model(shapes.one_sided_bump(0.02, at=0.1), RelaxedSlip()).having(DifferentialCompliance()), Start()),
    "past its stops": (model(shapes.flat(), RelaxedSlip()), Start()),
    "two-widths": (model(shapes.bump(at=0.2, ground=1), RelaxedSlip(), rover=narrow_in_front(ROVER)), Start()),
}


DUTY = {"held": 0.0, "held, eq-1": 0.0}
"""Share of the duties where it is not 1: near rest the law is a blend of both directions."""


def bent(state):
    """Bend bogies past their stops, one way and the other, one of them on its way back."""
    bends = (("bogie_l", 0.7, 0.3), ("bogie_r", -0.7, 4.0), ("rocker_l", 0.4, 0.1), ("rocker_r", -0.4, -0.1))
    for joint, angle, rate in bends:
        place = ROVER.angles[joint]
        dof = next(each.idx_v for each in list(ROVER.model.joints)[2:] if each.idx_q == place)
        state.q[place], state.v[dof] = angle, rate
    state.q[2] = 0.3


def assert_alike(plain, kernel):
    """All that a step changes or tells is the same in both."""
    other, state = plain.state, kernel.state
    assert other.q == pytest.approx(state.q, abs=1e-11)
    assert other.v == pytest.approx(state.v, abs=1e-9)
    assert other.contact == pytest.approx(state.contact, abs=1e-9)
    assert other.motor == pytest.approx(state.motor, abs=1e-9)
    assert plain.record == pytest.approx(kernel.record, rel=1e-8, abs=1e-8)
    assert plain.loads == pytest.approx(kernel.loads, rel=1e-8, abs=1e-8)
    assert plain.energy == pytest.approx(kernel.energy, rel=1e-9, abs=1e-10)
    assert plain.impulse == pytest.approx(kernel.impulse, rel=1e-9, abs=1e-10)
    assert plain.misjudged == pytest.approx(kernel.misjudged, rel=1e-6, abs=1e-9)
    assert plain.foreseen == pytest.approx(kernel.foreseen, rel=1e-8, abs=1e-8)
    assert plain.differential == pytest.approx(kernel.differential, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_steps_agree(name):
    """State by state, so that a chaotic moment cannot hide an error or make one."""
    made, start = CASES[name]
    state = settled(made, start)
    if name == "past its stops":
        bent(state)
    kernel = Kernel(made, state, 0.005, symmetric=False)
    other = state.copy()
    plain = Plain(made, other, 0.005, symmetric=False)
    duty, steer = DUTY.get(name, 1.0) * np.linspace(0.4, 0.9, 6), np.array([0.1, 0.12, -0.1, -0.12])
    for k in range(1200):
        if k == 900:
            duty = -duty
        kernel.duty[:], kernel.servo_target[:] = duty, steer
        if k % 40 == 0:
            for mine, theirs in (
                (other.q, state.q),
                (other.v, state.v),
                (other.contact, state.contact),
                (other.motor, state.motor),
            ):
                mine[:] = theirs
            plain.duty[:], plain.servo_target[:] = duty, steer
            plain.energy[:], plain.impulse[:], plain.foreseen[:] = kernel.energy, kernel.impulse, kernel.foreseen
            plain.record[:] = kernel.record
            assert (plain.step(), kernel.step()) == (0, 0)
            assert_alike(plain, kernel)
        else:
            assert kernel.step() == 0
    assert kernel.pivoted == 0, "rows were exchanged, which hides what the elimination does"


@pytest.mark.parametrize("name", CASES)
def test_a_step_agrees_where_everything_moves(name):
    """From a state that no drive comes to, so that no term is 0."""
    made, start = CASES[name]
    assert assert_a_step_alike(made, stirred(made, settled(made, start)), symmetric=False) > 0.0


def test_a_step_agrees_that_is_made_symmetric():
    made, start = CASES["hills"]
    state = stirred(made, settled(made, start))
    assert_a_step_alike(made, state, symmetric=True)
    perm, sign = ROVER.mirror
    assert np.array_equal(state.v, sign * state.v[perm])


def stirred(made, state):
    """Every joint bent and turning, every shear another, and all but a wheel or two pressed into the ground."""
    rng, held = np.random.default_rng(11), constraint_rows(ROVER)
    free = np.eye(len(state.v)) - np.linalg.pinv(held) @ held
    state.q[:] = pin.integrate(ROVER.model, state.q, free @ (0.005 * rng.normal(size=len(state.v))))
    state.v[:] = free @ (0.1 * rng.normal(size=len(state.v)))
    state.contact *= rng.uniform(0.8, 1.2, size=state.contact.shape)
    state.contact += 0.02 * rng.uniform(size=state.contact.shape)
    loads = np.zeros(6)
    while np.count_nonzero(loads > 0.0) < 4:
        state.q[2] -= 5e-4
        probe = Kernel(made, state.copy(), 1e-6, symmetric=False)
        assert probe.step() == 0
        loads = probe.record[:, RECORD.index("normal")]
    return state


def assert_a_step_alike(made, state, symmetric):
    """Return what the second step found misjudged."""
    plain, kernel = Plain(made, state.copy(), 0.005, symmetric), Kernel(made, state, 0.005, symmetric)
    for stepper in (plain, kernel):
        stepper.duty[:] = np.linspace(-0.3, 0.9, 6)
        stepper.servo_target[:] = [0.1, 0.12, -0.1, -0.12]
    for _ in range(2):  # the second knows what the first took the loads to become
        assert (plain.step(), kernel.step()) == (0, 0)
        assert_alike(plain, kernel)
    return kernel.misjudged


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_step_agrees_past_the_stops(way):
    """Bent further and on the way back, at either end of every joint, so that stops push and take energy."""
    made, start = CASES["past its stops"]
    state = stirred(made, settled(made, start))
    bent(state)
    for joint in ("bogie_l", "bogie_r", "rocker_l", "rocker_r"):
        state.q[ROVER.angles[joint]] *= way
    assert_a_step_alike(made, state, symmetric=False)


@pytest.mark.parametrize("share", [1e-3, 1e3])
def test_what_a_step_misjudged_is_told_alike(share):
    """One load of one wheel at a time foreseen otherwise: of wheels that carry more than a share, and less of it."""
    made, start = CASES["two-widths"]
    state, told = settled(made, start), []
    plain, kernel = Plain(made, state.copy(), 0.005, False), Kernel(made, state, 0.005, False)
    plain.share = kernel.struct.wheel_share = share
    for _ in range(2):
        assert (plain.step(), kernel.step()) == (0, 0)
    saved = plain.saved(), kernel.saved()
    for wheel in range(6):
        for load in range(4):
            for stepper, before in zip((plain, kernel), saved, strict=True):
                stepper.restore(before)
                stepper.foreseen[wheel, load] += -2.0 if load == 2 and wheel % 2 else 0.01 * wheel + 0.1
                assert stepper.step() == 0
            told.append(kernel.misjudged)
            assert plain.misjudged == pytest.approx(kernel.misjudged, rel=1e-6)
    assert len({round(each, 9) for each in told}) > 8, "left and right are alike, and no more"


def through_rest(state, share):
    """Let the rover creep forwards and its wheels turn back, or the other way, at such a share of `direction_speed`."""
    state.v[:] = 0.0
    state.v[0] = share * DIRECTION_SPEED
    for at, wheel in enumerate(ROVER.wheels):
        state.v[wheel.dof] = (1.0 - 0.35 * at) * share * DIRECTION_SPEED / float(wheel.wheel.r)


@pytest.mark.parametrize("name", ["held", "eq-1"])
def test_steps_agree_through_rest(name):
    """There the law is a blend of both directions, whose weights a wheel passes in a step or two."""
    made, start = CASES[name]
    rest = settled(made, start)
    for share in np.linspace(-1.5, 1.5, 31):
        states = [rest.copy(), rest.copy()]
        for state in states:
            through_rest(state, share)
        kernel, plain = (kind(made, state, 0.005, False) for kind, state in zip((Kernel, Plain), states, strict=True))
        assert (kernel.step(), plain.step()) == (0, 0)
        assert states[1].v == pytest.approx(states[0].v, abs=1e-11)
        assert plain.loads == pytest.approx(kernel.loads, rel=1e-8, abs=1e-9)
        assert plain.foreseen == pytest.approx(kernel.foreseen, rel=1e-8, abs=1e-9)


def test_the_cases_meet_what_they_are_for():
    """A lane's edge that pushes a wheel sideways, and forces that turn under loads of some mN."""
    made, start = CASES["astride-an-edge"]
    kernel = Kernel(made, settled(made, start), 0.005, symmetric=False)
    kernel.step()
    assert np.abs(kernel.record[:, RECORD.index("lateral")]).max() > 0.05 * kernel.record[:, 3].max()
    made, start = CASES["light"]
    kernel = Kernel(made, settled(made, start), 0.005, symmetric=False)
    kernel.duty[:] = 0.9
    worst = 0.0
    for _ in range(100):
        kernel.step()
        worst = max(worst, kernel.misjudged)
    assert kernel.record[:, 3].max() < 0.1
    assert worst > 1e-3


def test_a_rover_without_a_differential_has_no_torque_in_it():
    made = scenario("flat", rover="cart").model
    kernel = Kernel(made, settled(made, Start()), 0.005, symmetric=False)
    kernel.duty[:] = 0.5
    assert [kernel.step() for _ in range(20)] == [0] * 20
    assert kernel.differential.tolist() == [0.0]


@pytest.mark.parametrize("kind", [Kernel, Plain])
def test_steps_that_are_taken_back_leave_nothing_behind(kind):
    """A motor whose current and supply, and gears whose wind-up, the next step reads as well."""
    made = CASES["two-widths"][0].having(SupplySag())
    state = settled(made, Start())
    stepper = kind(made, state, 0.005, False)
    stepper.duty[:] = np.linspace(0.4, 0.9, 6)
    for _ in range(5):
        stepper.step()
    saved = stepper.saved()
    ends = []
    for _ in range(2):
        stepper.restore(saved)
        assert [stepper.step() for _ in range(4)] == [0] * 4
        ends.append([stepper.misjudged, *(each.tobytes() for each in stepper.saved())])
    assert ends[0] == ends[1]


def test_a_dropped_rover_is_the_same_in_both():
    """All wheels in the air, then touching."""
    made, start = CASES["ditch"]
    state = settled(made, start)
    state.q[2] += 0.01
    other = state.copy()
    kernel, plain = Kernel(made, state, 0.005, False), Plain(made, other, 0.005, False)
    for _ in range(40):
        assert (kernel.step(), plain.step()) == (0, 0)
    assert other.q == pytest.approx(state.q, abs=1e-9)
    assert kernel.record[:, 2].min() > 0.0


def test_the_mirror_symmetric_mode_is_symmetric():
    made, start = CASES["ditch"]
    state = settled(made, start, symmetric=True)
    kernel = Kernel(made, state, 0.005, symmetric=True)
    kernel.duty[:] = 0.8
    for _ in range(2000):
        kernel.step()
    perm, sign = ROVER.mirror
    assert np.array_equal(state.v, sign * state.v[perm])
    assert state.q[1] == 0.0


def test_changed_soils_act_as_if_they_had_been_there_from_the_start():
    made, start = CASES["eq-1"]
    firmer = tuple(soil.replace(phi=soil.phi * 1.1) for soil in made.soils)
    state = settled(made, start)
    other = state.copy()
    kernel = Kernel(made, state, 0.005, symmetric=False)
    fresh = Kernel(dataclasses.replace(made, soils=firmer), other, 0.005, symmetric=False)
    kernel.resoil(np.array([list(soil.values().values()) for soil in firmer]))
    for _ in range(100):
        kernel.duty[:] = fresh.duty[:] = 0.7
        assert (kernel.step(), fresh.step()) == (0, 0)
    assert np.array_equal(state.q, other.q)
    assert np.array_equal(kernel.record, fresh.record)
