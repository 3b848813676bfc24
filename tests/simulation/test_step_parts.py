"""Parts of the compiled step by themselves, each against something that knows no C."""

import ctypes
import math

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest

from rover_pin.effects.supply_sag import SupplySag
from rover_pin.rover.constraints import constraint_rows
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation import native
from rover_pin.simulation.compiled import toolchain
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.rover_numbers import armed
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.start.place import Start, settled

SHARE = "static double implicit_share(const Drive *d) { return 0.5; }\n"
NEEDED = "lanes.h types.h shared.py drive.h system.h arc.c states.c solve.c configuration.c".split()
PROBES = """
void probe_base(double *q, const double *v, double dt) { advance_base(q, v, dt); }
void probe_arc(const double *ends, double h, double radius, double n, double *out) {
  const Arc arc = arc_of(h, radius);
  double found[N_ENDS][2];
  depth_integrals(ends, &arc, n, found);
  memcpy(out, found, sizeof found);
}
"""


def at(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@pytest.fixture(scope="module")
def parts():
    """Inner functions of the step as a library, from the files that they need."""
    text = "".join(SHARE * (name == "solve.c") + native._text(name) for name in NEEDED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", ("-O0", *toolchain.FLAGS[1:]))
        made = toolchain.shared_library(text + PROBES, "parts")
    pointer = ctypes.POINTER(ctypes.c_double)
    made.probe_base.argtypes = [pointer, pointer, ctypes.c_double]
    made.probe_arc.argtypes = [pointer, *[ctypes.c_double] * 3, pointer]
    return made


ANGLES = [0.0, 1e-9, 1e-4, 0.03, 0.09, 0.0999999, 0.1000001, 0.2, 1.5, 3.0]


def screw(v, dt):
    """exp of a twist (u, w) dt in 40 digits: translation, and the quaternion (x, y, z, w)."""
    with mp.workdps(40):
        u, w = (mp.matrix([mp.mpf(float(x)) * mp.mpf(dt) for x in part]) for part in (v[:3], v[3:]))
        W = mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        angle = mp.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
        a = (1 - mp.cos(angle)) / angle**2 if angle else mp.mpf(1) / 2
        b = (angle - mp.sin(angle)) / angle**3 if angle else mp.mpf(1) / 6
        s = mp.sin(angle / 2) / angle if angle else mp.mpf(1) / 2
        move = u + a * (W * u) + b * (W * (W * u))
        return np.array([float(x) for x in move]), np.array([*(float(s * x) for x in w), float(mp.cos(angle / 2))])


@pytest.mark.parametrize("angle", ANGLES)
def test_the_base_moves_along_a_screw_to_the_last_digit(parts, angle):
    """Half a step at a steady twist, by series below a tenth of a radian and by sines above."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        axis = rng.normal(size=3)
        v = np.concatenate([rng.normal(size=3), 400.0 * angle * axis / np.linalg.norm(axis)])
        move, turned = screw(v, 0.0025)
        rest = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        parts.probe_base(at(rest), at(v), 0.0025)
        assert rest[:3] == pytest.approx(move, rel=0.0, abs=5e-16 * np.linalg.norm(v[:3]) * 0.0025)
        assert rest[3:] == pytest.approx(turned, rel=0.0, abs=2.3e-16)
        q = np.concatenate([rng.normal(size=3), pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()])
        wanted = pin.SE3(pin.Quaternion(q[3:]).matrix(), q[:3]) * pin.SE3(pin.Quaternion(turned).matrix(), move)
        parts.probe_base(at(q), at(v), 0.0025)
        assert q[:3] == pytest.approx(wanted.translation, abs=1e-15)
        assert pin.Quaternion(q[3:]).matrix() == pytest.approx(wanted.rotation, abs=2e-15)


@pytest.mark.parametrize("n", [0.5, 0.9, 1.0, 1.7])
@pytest.mark.parametrize("h", [1e-4, 0.01, 0.045])
def test_integrals_of_the_depth_over_an_arc(parts, n, h):
    """int (cos t - cos theta_0)^n {cos t, 1} dt from three ends, against adaptive quadrature in 20 digits."""
    radius, found = 0.045, np.zeros((3, 2))
    with mp.workdps(20):
        theta = mp.acos(1 - mp.mpf(h) / mp.mpf(radius))
        ends = np.array([0.0, 0.4 * float(theta), -0.7 * float(theta)])
        parts.probe_arc(at(ends), h, radius, n, at(found))
        for end, (with_cosine, plain) in zip(ends, found, strict=True):
            for got, weight in ((with_cosine, mp.cos), (plain, lambda t: mp.mpf(1))):
                wanted = mp.quad(
                    lambda t, w=weight: max(mp.cos(t) - mp.cos(theta), mp.mpf(0)) ** mp.mpf(n) * w(t), [end, theta]
                )
                assert got == pytest.approx(float(wanted), rel=2e-6)


@pytest.mark.parametrize("kind", [Kernel, Plain])
def test_wheels_held_to_a_rate_have_it_and_what_it_takes_is_told(kind):
    """In the air: the torque is that of inverse dynamics for the acceleration that came of it, at half-way speeds."""
    model = scenario("flat").model.having(SupplySag())
    state = settled(model, Start())
    state.q[2] += 0.5
    stepper = kind(model, state, 0.005, False)
    rates = np.linspace(-2.0, 3.0, 6)
    stepper.hold(rates)
    q, v = state.q.copy(), state.v.copy()
    assert stepper.step() == 0
    wheels = [mount.dof for mount in model.rover.wheels]
    assert state.v[wheels] == pytest.approx(rates, abs=1e-6)
    armoured = armed(model.built, float(model.motor.armature))
    half = pin.integrate(armoured, q, 0.0025 * v)
    needed = pin.rnea(armoured, armoured.createData(), half, v, (state.v - v) / 0.005)
    assert stepper.record[:, 9] == pytest.approx(needed[wheels], rel=1e-6)
    before = state.v[wheels].copy()
    assert stepper.step() == 0
    assert state.v[wheels] == pytest.approx(before, abs=1e-6), "held on"


MODEL = scenario("flat").model


def test_a_plain_step_whose_numbers_are_lost_says_so():
    begun = settled(MODEL, Start())
    begun.v[0] = math.nan
    assert Plain(MODEL, begun, 0.005, False).step() == 1


def test_plain_step_returns_a_forced_differential_to_its_tie():
    """The compiled step, which eliminates the follower, keeps what it was given: drives begin tied."""
    begun, rover = settled(MODEL, Start()), MODEL.built
    begun.v[rover.differential.left] = 0.3
    G = constraint_rows(rover)
    assert np.abs(G @ begun.v).max() == pytest.approx(0.3)
    assert Plain(MODEL, begun, 0.005, False).step() == 0
    assert np.abs(G @ begun.v).max() < 1e-9
