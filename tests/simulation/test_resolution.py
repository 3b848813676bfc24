"""A step that is too long for stiff ground is divided into parts, or refused."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, Soil, scenario, simulate
from rover_pin.base.errors import SimulationError
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.rover.forward_dynamics import constraint_rows, mass_matrix, wheel_jacobians
from rover_pin.simulation.compiled.drive_fields import model_with_armature
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.outcome.audit import balance_warning, load_warning, mean_load
from rover_pin.simulation.replay import commands, replay
from rover_pin.simulation.start import Start, settled_state
from rover_pin.simulation.stepping.pace import ROUGH, Pace
from rover_pin.simulation.stepping.resolution import MAX_PARTS, contact_frequency, firmness, parts, stiffness
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.trace.record import finite, row_type
from rover_pin.terrain import shapes


def test_stiffness_is_the_slope_of_the_sinkage_law():
    """The stiffness is compared with a difference of the compiled law's normal force. The closed form holds for small
    angles.
    """
    model = scenario("flat", **{"soil.k_1": 1e7}).model
    state = settled_state(model, Start())
    kernel = Kernel(model, state.copy(), 1e-9, symmetric=False)
    kernel.step()
    loads, h = kernel.record[:, 3].copy(), kernel.record[:, 2].copy()
    kernel.state.q[2] -= 1e-3 * h.min()
    kernel.step()
    slope = (kernel.record[:, 3] - loads) / (kernel.record[:, 2] - h)
    expected = [stiffness(float(load), model.rover.wheel, model.soils[0]) for load in loads]
    assert slope == pytest.approx(expected, rel=0.02)


def test_stiffness_scales_with_modulus_and_load_or_is_zero():
    wheel = scenario("flat").model.rover.wheel
    weak = Soil(k_1=1e-6 * Soil().k_1)
    assert stiffness(1e-5, wheel, weak) == pytest.approx(1e-6 * stiffness(10.0, wheel, Soil()), rel=1e-6)
    assert stiffness(10.0, wheel, Soil(k_1=0.0)) == stiffness(10.0, wheel, Soil(k_1=-5.0)) == 0.0


@pytest.mark.parametrize("k_1", [1e6, 1e7])
def test_contact_frequency_is_that_of_a_small_disturbance(k_1):
    """An undamped disturbance is stable just below omega dt = 2 and unstable just above, which is the limit of a
    Stoermer-Verlet step.
    """
    model = scenario("flat", **{"soil.k_1": k_1, "effect.NormalDamping.d": 0.0}).model
    state = settled_state(model, Start())
    omega = contact_frequency(model, state)

    def grown(turn):
        kernel = Kernel(model, state.copy(), turn / omega, symmetric=False)
        kernel.state.v[2] = 1e-9
        for _ in range(400):
            kernel.step()
        return float(np.abs(kernel.state.v[:6]).max())

    assert grown(1.7) < 1e-6
    assert not grown(2.4) < 1e-3


def test_the_frequency_is_that_of_the_rover_s_own_mass_matrix():
    """The expected frequency solves omega^2 x = M^-1 U^T K U x under the differential, with its multiplier as an
    unknown, so that no part of the matrix is inverted alone.
    """
    model = scenario("flat").model
    state = settled_state(model, Start())
    rover = model.built
    M = mass_matrix(rover, state.q) + np.diag(model_with_armature(rover, float(model.motor.armature)).armature)
    G = constraint_rows(rover)
    U = np.array([J[2] for J in wheel_jacobians(rover, state.q)])
    W = model.gravity * rover.mass / len(rover.wheels)
    K = np.diag([stiffness(W, mount.wheel, model.soils[0]) for mount in rover.wheels])
    saddle = np.block([[M, G.T], [G, np.zeros((len(G), len(G)))]])
    pushed = np.linalg.solve(saddle, np.vstack([U.T @ K @ U, np.zeros((len(G), len(M)))]))[: len(M)]
    assert contact_frequency(model, state) ** 2 == pytest.approx(np.linalg.eigvals(pushed).real.max(), rel=1e-9)


@pytest.mark.parametrize("name", ["flat", "ditch", "hills"])
@pytest.mark.parametrize("k_1", [3e7, 1e9])
def test_stiff_ground_is_driven_with_the_weight_on_the_wheels(name, k_1):
    """With an undivided step, the rover would hop by 36 to 152 mm under 6 to 137 times its weight, with an energy error
    below 1 %.
    """
    drive = scenario(name, duration=4.0, **{"soil.k_1": k_1, "soil.k": 0.01, "cruise_slip": 0.05})
    trace = drive.drive()
    weight = drive.model.rover.mass * drive.model.gravity
    assert trace.attrs["dt_s"] < 0.005
    assert trace.stack("normal").sum(axis=1).mean() == pytest.approx(weight, rel=0.03)
    assert trace.attrs["warnings"] == []
    half = dataclasses.replace(drive, timing=drive.timing.with_half_step()).drive(measure_error=False)
    assert half.attrs["dt_s"] == pytest.approx(trace.attrs["dt_s"] / 2)
    assert np.abs(half["body_x"] - trace["body_x"]).max() < 1e-3


def test_ground_made_firmer_by_an_effect_needs_a_finer_step():
    """The front wheels press ruts that are, under the last axle, 24 times as stiff as the soil's own constants."""
    settings = {"soil.k_1": 5e6, "soil.k": 0.01, "duration": 2.0}
    plain, firm = scenario("flat", **settings), scenario("flat", **settings)
    firm = dataclasses.replace(firm, model=firm.model.having(MultiPass(stiffening=5.0)))
    traces = plain.drive(), firm.drive()
    assert traces[1].attrs["dt_s"] < traces[0].attrs["dt_s"]
    assert not any("average" in warning for warning in traces[1].attrs["warnings"])
    state = settled_state(plain.model, Start())
    assert firmness(Kernel(plain.model, state.copy(), 1e-9, False), plain.model) == pytest.approx(1.0, abs=0.15)


def test_the_shipped_grounds_keep_their_step_or_half_of_it():
    for soil, most in {"table-1": 1, "dry-sand": 1, "lunar-nominal": 1, "mars-sand": 2}.items():
        model = scenario("flat", soil=soil).model
        assert parts(model, settled_state(model, Start()), Timing().dt) <= most


def test_the_firmest_ground_of_the_terrain_decides():
    soft = scenario("bump").model
    hard = soft.replace(terrain=shapes.bump(ground=1), soils=(soft.soils[0], Soil(k_1=1e8)))
    state = settled_state(soft, Start())
    assert parts(hard, state, 0.005) > parts(soft, state, 0.005) == 1


def test_too_stiff_ground_is_refused_in_one_sentence():
    model = scenario("flat").model
    state = settled_state(model, Start())
    stiff = model.replace(soils=(Soil(k_1=1e9, n=0.1), *model.soils[1:]))
    message = rf"too stiff for dt = 0\.0166667 s: .* at .* rad/s, .* {MAX_PARTS} are allowed"
    for start in (state, Start()):
        with pytest.raises(SimulationError, match=message):
            simulate(stiff, ConstantDuty(0.5), 1.0, start)
    omega = contact_frequency(stiff, state)
    assert parts(stiff, state, (MAX_PARTS - 0.5) * 1.2 / omega) == MAX_PARTS
    assert parts(stiff, state, 3.0 * (1.0 + 1e-12) * 1.2 / omega) == 3, "round-off is no part"
    with pytest.raises(SimulationError, match=rf"{MAX_PARTS + 1}.*{MAX_PARTS}"):
        parts(stiff, state, (MAX_PARTS + 0.5) * 1.2 / omega)


def test_steps_that_miss_the_load_give_a_warning_or_are_halved(monkeypatch):
    """The step is not divided here. Without the error estimate a warning is given; with it, the drive is repeated at a
    stable step.
    """
    monkeypatch.setattr("rover_pin.simulation.stepping.tolerance.parts", lambda *_: 1)
    measured = scenario("flat", duration=4.0, **{"soil.k_1": 3e7, "soil.k": 0.01}).drive()
    assert (measured.attrs["dt_s"] < 0.005, measured.attrs["warnings"]) == (True, [])
    trace = scenario("flat", duration=4.0, **{"soil.k_1": 1e8, "soil.k": 0.01}).drive(measure_error=False)
    assert any("rover's weight" in warning for warning in trace.attrs["warnings"])
    assert trace.summary()["warnings"] == trace.attrs["warnings"]


def test_a_replay_on_stiff_ground_divides_its_step_too():
    drive = scenario("flat", duration=3.0, **{"soil.k_1": 1e8, "soil.k": 0.01})
    trace, model = drive.drive(), drive.model
    steered = tuple(mount.name for mount in model.rover.wheels if mount.steer_dof is not None)
    again = replay(model, commands(trace, trace.wheels, steered)).channels
    load = sum(again[f"normal_{wheel}"] for wheel in trace.wheels).mean()
    assert load == pytest.approx(model.rover.mass * model.gravity, rel=0.02)
    assert again["body_x"][-1] == pytest.approx(trace["body_x"][-1], abs=2e-3)


def park(**settings):
    """Return the cart on a slope with a slip law and a shear that are so stiff that one step passes over the whole
    range of slip.
    """
    return scenario(
        "park", rover="cart", form="gross", slip="algebraic", duration=2.0, gravity=11.06,
        **{"soil.k": 0.0006, "soil.phi_deg": 12.7, "soil.k_1": 3.7e6, "start.yaw_deg": -77.0, **settings},
    )  # fmt: skip


def test_shear_stiffer_than_the_step_does_not_shake_wheels_loose():
    """With an unstable step, the cart would slide by 3.9 m in 4 s. Steps that are 4 and 32 times finer creep
    by 2.1 mm.
    """
    drive = park()
    coarse = drive.drive()
    fine = dataclasses.replace(drive, timing=dataclasses.replace(drive.timing, divided=16)).drive()
    for axis in ("body_x", "body_y"):
        assert np.abs(coarse[axis] - fine[axis]).max() < 5e-4


class Rough:
    """A motion in time whose forces change fast within `span`: there, a step of `length` has the forecast error rate
    length^2.
    """

    def __init__(self, span, rate, explodes=math.inf):
        self.span, self.rate, self.explodes = span, rate, explodes
        self.t, self.dt, self.error, self.misjudged, self.growth = np.zeros(1), 64.0, np.zeros(1), 0.0, 0.0
        self.tried, self.kept = [], []

    def set_step(self, dt):
        self.dt = dt

    def saved_arrays(self):
        return [self.t.copy(), self.error.copy(), np.array(len(self.kept))]

    def restore(self, saved):
        self.t[:], self.error[:] = saved[:2]
        del self.kept[int(saved[2]) :]

    def step(self):
        self.misjudged, inside = float(self.error[0]), self.span[0] <= self.t[0] < self.span[1]
        self.error[0] = self.rate * self.dt**2 if inside else 0.0
        self.tried.append(self.dt)
        self.kept.append((float(self.t[0]), self.dt))
        self.t += self.dt
        return int(inside and self.dt > self.explodes)


class Growing(Rough):
    """A motion whose speed grows within `span` in steps of 16 or more, without any forecast error."""

    def __init__(self, span):
        super().__init__(span, 0.0)

    def step(self):
        self.growth = 3.0 if self.span[0] <= self.t[0] < self.span[1] and self.dt > 8.0 else 0.0
        return super().step()


def driven(stub, steps=8, commanded=lambda k: k == 0):
    pace = Pace(stub, 64.0)
    assert [pace.advance(commanded(k)) for k in range(steps)] == [0] * steps
    ends = np.cumsum([0.0, *(length for _, length in stub.kept)])
    assert ends[-1] == stub.t[0] == 64.0 * steps
    np.testing.assert_array_equal(ends[:-1], [begin for begin, _ in stub.kept])
    return pace


@pytest.mark.parametrize("commanded", [True, False])
def test_step_that_is_outgrown_is_repeated_in_quarters_at_once(commanded):
    """This also holds for the last step before a command, whose end is not examined otherwise."""
    stub = Growing((150.0, 200.0))
    driven(stub, commanded=lambda k: commanded)
    inside = [length for begin, length in stub.kept if 150.0 <= begin < 200.0]
    assert inside
    assert max(inside) <= 8.0
    assert [length for begin, length in stub.kept if begin < 128.0] == [64.0, 64.0]


def test_step_with_mispredicted_forces_is_repeated_in_quarters():
    """Steps of 4 have the error 0.8 ROUGH, and steps of 16 have 12.8 ROUGH. No step with a larger error than ROUGH is
    kept.
    """
    stub = Rough((130.0, 200.0), ROUGH / 20.0)
    driven(stub)
    assert max(length for begin, length in stub.kept if 130.0 <= begin < 200.0) <= 4.0
    assert [length for begin, length in stub.kept if begin < 64.0] == [64.0]
    assert stub.kept[-1][1] == 64.0
    assert len(stub.tried) > len(stub.kept)


def test_steps_have_the_requested_length_where_no_force_changes():
    stub = Rough((0.0, 0.0), 1.0)
    driven(stub)
    assert stub.tried == [64.0] * 8


def test_a_step_before_a_command_is_not_taken_again():
    """The steps after it are nevertheless taken in quarters."""
    stub = Rough((128.0, 192.0), ROUGH / 1000.0)
    driven(stub, commanded=lambda k: True)
    assert (128.0, 64.0) in stub.kept
    assert (192.0, 64.0) in stub.kept
    assert stub.kept[4][1] == 16.0


def test_a_step_that_explodes_is_taken_again_until_the_finest():
    stub = Rough((100.0, 140.0), 0.0, explodes=2.0)
    driven(stub)
    assert max(length for begin, length in stub.kept if 100.0 <= begin < 140.0) <= 2.0
    assert Pace(Rough((0.0, 1.0), 0.0, explodes=0.0), 64.0).advance() == 1


def rows_of(model, count, duration=3.0):
    """Return rows of a rover at rest."""
    rows = np.zeros(count, dtype=row_type(model))
    rows["t"] = np.linspace(0.0, duration, count)
    normal = rows["record"][:, :, RECORD.index("normal")]
    normal[...] = model.gravity * model.built.mass / normal.shape[1]
    rows["impulse"] = np.outer(rows["t"], model.built.up) * model.gravity * model.built.mass
    return rows


@pytest.mark.parametrize("rise", [0.0, 0.6])
def test_a_load_above_the_weight_accelerates_the_rover(rise):
    """Newton's second law: I . up = m g T + m dv. Momentum along the slope does not count as weight."""
    model = scenario("flat").model
    model = dataclasses.replace(model, rover=model.rover.rising(rise, 0.0))
    rows, mass, up = rows_of(model, 60), model.built.mass, model.built.up
    assert mean_load(model, rows) == pytest.approx(1.0)
    gained = np.linspace(0.2, 1.2, 60)
    rows["velocity"] += gained[:, None] * up + np.outer(3.0 * gained, np.cross(up, [0.0, 1.0, 0.0]))
    rows["impulse"] += mass * gained[:, None] * up
    assert mean_load(model, rows) == pytest.approx(1.0)
    rows["impulse"] += 0.3 * np.outer(rows["t"], up) * mass * model.gravity
    assert mean_load(model, rows) == pytest.approx(1.3)


@pytest.mark.parametrize(("share", "warns"), [(0.9890, True), (0.9910, False), (1.0090, False), (1.0110, True)])
def test_a_drive_is_believed_where_the_soil_carried_the_weight_to_one_percent(share, warns):
    model = scenario("flat").model
    rows = rows_of(model, 60)
    rows["impulse"] *= share
    assert bool(load_warning(model, rows)) is warns


@pytest.mark.parametrize(("duration", "warns"), [(0.49, False), (0.51, True)])
def test_a_drive_of_less_than_half_a_second_is_not_weighed(duration, warns):
    model = scenario("flat").model
    rows = rows_of(model, 60, duration)
    rows["impulse"] *= 2.0
    assert bool(load_warning(model, rows)) is warns


@pytest.mark.parametrize(("share", "warns"), [(0.006, False), (0.014, True)])
def test_an_energy_account_may_be_off_by_one_percent_of_its_greatest(share, warns):
    trace = scenario("flat", duration=1.0).drive()
    greatest = max(float(np.ptp(values)) for name, values in trace.channels.items() if name.startswith("energy_"))
    gained = trace["energy_motor"] + np.linspace(0.0, share * greatest, len(trace.t))
    off = dataclasses.replace(trace, channels={**trace.channels, "energy_motor": gained})
    assert bool(balance_warning(off)) is warns


def test_energy_that_does_not_balance_is_reported():
    trace = scenario("flat", duration=1.0).drive()
    assert balance_warning(trace) == ""
    gained = trace["energy_motor"] + np.linspace(0.0, 0.1 * np.ptp(trace["energy_motor"]), len(trace.t))
    assert "does not balance" in balance_warning(
        dataclasses.replace(trace, channels={**trace.channels, "energy_motor": gained})
    )


def test_rows_from_the_first_nonfinite_number_on_are_dropped():
    """The numbers of a diverging rover overflow; its trace must contain no NaN."""
    rows = rows_of(scenario("flat").model, 9)
    assert len(finite(rows)) == 9
    rows["q"][5, 2], rows["energy"][7, 0] = np.nan, np.inf
    assert len(finite(rows)) == 5
    rows["energy"][0, 1] = -np.inf
    assert len(finite(rows)) == len(finite(rows[:0])) == 0


def test_drive_without_rows_or_with_lost_numbers_is_not_good():
    model = scenario("flat").model
    rows = rows_of(model, 60)
    rows["impulse"][-1] = np.nan
    assert mean_load(model, rows) == math.inf
    assert "inf times" in load_warning(model, rows)
