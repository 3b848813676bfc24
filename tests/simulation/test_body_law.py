"""The compiled law of the body effects is compared with plain numbers: SciPy computes the kinematics, and differences
give the derivatives.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rover_pin.effects.effect import Body, BodyEffect, Push
from rover_pin.simulation.compiled.body_law import body_law, elastic_energy
from rover_pin.simulation.state import Joints

JOINTS = Joints(3, (2, 0), ("rocker_r", "bogie_l", "rocker_l"))
M = 6 + JOINTS.number


@dataclass(frozen=True)
class Everything(BodyEffect):
    """A body effect whose force and moments contain a different product of every quantity that an effect can use."""

    def push(self, body):
        """Return them."""
        a, b, c = body.angles
        force = body.x * body.v_y + 2.0 * body.yaw * body.w_x, body.y * body.roll - body.v_z * a, body.z * body.w_z * b
        moment = body.pitch * body.v_x + body.rates[1], body.w_y * body.x + c * c, body.twist * body.twist_rate
        torques = (
            -body.known_rates[0] ** 2 * body.rates[0], 0.4 * b * body.rates[2] + body.y, body.known_rates[1] * c,
        )  # fmt: skip
        return Push(*force, *moment, torques, 3.0 * body.twist + 0.5 * body.twist_rate * body.z)

    def stored_energy(self, body):
        """Return some energy of place and attitude."""
        return body.z * body.roll + body.pitch * body.angles[1] + body.yaw * body.x + 4.0 * body.twist * body.twist


@dataclass(frozen=True)
class Lift(BodyEffect):
    """A body effect that pushes upwards and acts on no joint."""

    def push(self, body):
        """Return it."""
        return Push(f_z=7.0 + body.v_x)

    def stored_energy(self, body):
        """Return the energy of its height."""
        return -7.0 * body.z


EFFECTS = (Everything(), Lift())


@dataclass
class Seen:
    """The configuration and the speeds of a rover."""

    place: np.ndarray
    turn: Rotation
    speed: np.ndarray
    angles: np.ndarray
    rates: np.ndarray

    def body(self, known_values):
        yaw, pitch, roll = self.turn.as_euler("ZYX")
        velocity, spin = self.turn.apply(self.speed[:3]), self.turn.apply(self.speed[3:])
        twist, rate = (half[0] + half[2] for half in (self.angles, self.rates))
        return Body(
            *self.place, roll, pitch, yaw, *velocity, *spin, tuple(self.angles), tuple(self.rates), tuple(known_values),
            twist, rate, JOINTS.names,
        )  # fmt: skip

    def force(self, known_values):
        """Return the generalised force. Its last entry is the torque of the differential, which acts on both
        rockers.
        """
        pushes = [effect.push(self.body(known_values)) for effect in EFFECTS]
        turn, torques = self.turn.inv(), np.array(pushes[0].joints)
        torques[[0, 2]] += pushes[0].differential
        force, moment = (np.sum([half[part] for half in pushes], axis=0) for part in (slice(0, 3), slice(3, 6)))
        return np.r_[turn.apply(force), turn.apply(moment), torques, pushes[0].differential]

    def moved(self, speeds, time):
        """Return the state to which these speeds (base, joints) lead, with unchanged attitude."""
        return Seen(
            self.place + time * self.turn.apply(speeds[:3]), self.turn, self.speed, self.angles + time * speeds[6:],
            self.rates,
        )  # fmt: skip

    def faster(self, by):
        return Seen(self.place, self.turn, self.speed + by[:6], self.angles, self.rates + by[6:])

    def vector(self, half):
        return np.r_[self.place, self.turn.as_quat(), self.speed, self.angles, self.rates, half]


@pytest.fixture(params=range(3))
def recorder(request):
    random = np.random.default_rng(request.param)
    turn = Rotation.from_euler("ZYX", [[2.5, 0.9, -1.2], [-0.4, -1.1, 0.3], [1.0, 0.2, 2.8]][request.param])
    return Seen(*random.normal(size=(1, 3)), turn, *random.normal(size=(1, 6)), *random.normal(size=(2, 3)))


def split(truth, half):
    out = np.array(body_law(EFFECTS, JOINTS)(truth.vector(half), [], [])).ravel()
    assert len(out) == M + M * M + 1 + M
    force, slope, torque, torque_slope = np.split(out, np.cumsum([M, M * M, 1]))
    return np.r_[force, torque], np.vstack([slope.reshape((M, M), order="F"), torque_slope])


def difference(function, step=1e-5):
    return np.column_stack([(function(step * e) - function(-step * e)) / (2 * step) for e in np.eye(M)])


def test_force_is_the_push_of_the_effects_in_base_axes(recorder):
    force, slope = split(recorder, 0.0)
    np.testing.assert_allclose(force, recorder.force(recorder.rates), rtol=1e-9, atol=1e-9)
    by_speed = difference(lambda by: recorder.faster(by).force(recorder.rates))
    np.testing.assert_allclose(slope, by_speed, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("half", [0.01, 0.25])
def test_quantities_that_move_within_the_step_are_taken_at_its_end(recorder, half):
    """The expected values F + h dF/dq q' and dF/du + h dF/dq dq'/du come from differences. Rates that are known are not
    differentiated.
    """
    force, slope = split(recorder, half)
    force_now, rates = recorder.force(recorder.rates), recorder.rates
    drift = difference(lambda by: recorder.moved(by, 1.0).force(rates))
    by_speed = difference(lambda by: recorder.faster(by).force(rates))
    speeds = np.r_[recorder.speed, recorder.rates]
    np.testing.assert_allclose(force, force_now + half * drift @ speeds, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(slope, by_speed + half * drift, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_an_attitude_on_edge_is_no_nan(way):
    """Round-off may give sin(pitch) slightly above 1, or a quaternion whose norm is slightly above 1."""
    on_edge = np.r_[np.zeros(3), np.array([0.0, way, 0.0, 1.0]) * np.sqrt(0.5) * (1.0 + 1e-9), np.zeros(3)]
    energy = elastic_energy((Everything(),), JOINTS)(on_edge[:7], [0.0, 2.0, 0.0])
    assert float(energy) == pytest.approx(way * np.pi)
