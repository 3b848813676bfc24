"""A step too coarse for the ground is divided by itself, or refused; a drive that still misses says so."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.contact import Soil
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.rover.forward_dynamics import constraint_rows, mass_matrix, wheel_jacobians
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.rover_numbers import armed
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.outcome import half_step
from rover_pin.simulation.outcome.audit import airborne, balance_warning, braked, doubts_of, load_warning, mean_load
from rover_pin.simulation.pace import ROUGH, Pace
from rover_pin.simulation.replay import commands, replay
from rover_pin.simulation.resolution import MOST, contact_frequency, firmness, parts, stiffness
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.start.place import Start, settled
from rover_pin.simulation.trace.rows import finite, row_type
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain import shapes


def test_stiffness_is_the_slope_of_the_sinkage_law():
    """Against a difference of the compiled law's own normal force; the closed form holds for small angles."""
    model = scenario("flat", **{"soil.k_1": 1e7}).model
    state = settled(model, Start())
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


@pytest.mark.parametrize("k_1", [1e5, 1e7])
def test_contact_frequency_is_that_of_a_small_disturbance(k_1):
    """Stable just below omega dt = 2, unstable just above, as Stoermer-Verlet's step must be: undamped, from rest."""
    model = scenario("flat", **{"soil.k_1": k_1, "effect.NormalDamping.d": 0.0}).model
    state = settled(model, Start())
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
    """omega^2 x = M^-1 U^T K U x under the differential, its multiplier among the unknowns: no inverse of a part."""
    model = scenario("flat").model
    state = settled(model, Start())
    rover = model.built
    M = mass_matrix(rover, state.q) + np.diag(armed(rover, float(model.motor.armature)).armature)
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
    """It used to hop by 36 to 152 mm under 6 to 137 times its weight, with an energy error below 1 %."""
    drive = scenario(name, duration=4.0, **{"soil.k_1": k_1, "soil.k": 0.01, "cruise_slip": 0.05})
    trace = drive.drive()
    weight = drive.model.rover.mass * drive.model.gravity
    assert trace.attrs["dt_s"] < 0.005
    assert trace.stack("normal").sum(axis=1).mean() == pytest.approx(weight, rel=0.03)
    assert trace.attrs["warnings"] == []
    half = dataclasses.replace(drive, timing=drive.timing.halved()).drive()
    assert half.attrs["dt_s"] == pytest.approx(trace.attrs["dt_s"] / 2)
    assert np.abs(half["body_x"] - trace["body_x"]).max() < 1e-3


def test_ground_made_firmer_by_an_effect_needs_a_finer_step():
    """Ruts pressed firm by the wheels in front: 24 times as stiff as the soil's own constants under the last axle."""
    settings = {"soil.k_1": 5e6, "soil.k": 0.01, "duration": 2.0}
    plain, firm = scenario("flat", **settings), scenario("flat", **settings)
    firm = dataclasses.replace(firm, model=firm.model.having(MultiPass(stiffening=5.0)))
    traces = plain.drive(), firm.drive()
    assert traces[1].attrs["dt_s"] < traces[0].attrs["dt_s"]
    assert not any("average" in each for each in traces[1].attrs["warnings"])
    state = settled(plain.model, Start())
    assert firmness(Kernel(plain.model, state.copy(), 1e-9, False), plain.model) == pytest.approx(1.0, abs=0.15)


class Springs:
    """A rover at rest whose wheels stand on springs, some of `firmer` times the ground's own stiffness, some of 0."""

    def __init__(self, model, firmer, h=0.005):
        self.model, self.h = model, h
        self.state = settled(model, Start())
        self.rest, self.record = float(self.state.q[2]), np.zeros((6, len(RECORD)))
        self.springs = np.array([firmer, *[0.0] * 5]) * stiffness(10.0, model.rover.wheel, model.soils[0])

    def saved(self):
        return [self.state.q.copy(), self.record.copy()]

    def restore(self, saved):
        self.state.q[:], self.record[:] = saved

    def step(self):
        depth = self.rest - self.state.q[2]
        there = np.broadcast_to(self.h, 6) > 0.0
        self.record[:, RECORD.index("sinkage")] = np.where(there, self.h + depth, 0.0)
        self.record[:, RECORD.index("normal")] = np.where(there, 10.0 + self.springs * depth, 0.0)


@pytest.mark.parametrize(("firmer", "told"), [(0.5, 1.0), (1.05, 1.05), (30.0, 30.0), (99.0, 99.0), (105.0, 100.0)])
def test_firmness_is_how_much_stiffer_the_firmest_wheel_stands(firmer, told):
    model = scenario("flat").model
    stepper = Springs(model, firmer)
    assert firmness(stepper, model) == pytest.approx(told, rel=1e-6)
    assert stepper.state.q[2] == stepper.rest
    assert firmness(Springs(model, firmer, h=0.0), model) == 1.0, "in the air"
    lifted = Springs(model, firmer, h=np.array([0.005, 0.0, 0.0, 0.005, 0.005, 0.005]))
    assert firmness(lifted, model) == pytest.approx(told, rel=1e-6)


def test_the_lightest_rover_has_its_firmness_too():
    """Wheels that carry 20 mN, as of a rover of 12 g on the Moon's sixth, stand on the ground all the same."""
    model = scenario("flat").model
    stepper = Springs(model, 1.0)
    usual = stepper.step

    def step():
        usual()
        stepper.record[:, RECORD.index("normal")] -= 9.98

    stepper.step = step
    heavy, light = (stiffness(load, model.rover.wheel, model.soils[0]) for load in (10.0, 0.02))
    assert firmness(stepper, model) == pytest.approx(heavy / light, rel=1e-6)
    assert heavy > 5.0 * light


def test_the_shipped_grounds_keep_their_step():
    for soil in ("table-1", "dry-sand", "lunar-nominal", "mars-sand"):
        model = scenario("flat", soil=soil).model
        assert parts(model, settled(model, Start()), 0.005) == 1


def test_the_firmest_ground_of_the_terrain_decides():
    soft = scenario("bump").model
    hard = soft.replace(terrain=shapes.bump(ground=1), soils=(soft.soils[0], Soil(k_1=1e8)))
    state = settled(soft, Start())
    assert parts(hard, state, 0.005) > parts(soft, state, 0.005) == 1


def test_too_stiff_ground_is_refused_in_one_sentence():
    model = scenario("flat").model
    state = settled(model, Start())
    stiff = model.replace(soils=(Soil(k_1=1e9, n=0.1), *model.soils[1:]))
    message = rf"too stiff for dt = 0\.005 s: the rover vibrates on it at .* rad/s, .* {MOST} are allowed: lower soil"
    for start in (state, Start()):
        with pytest.raises(SimulationError, match=message):
            simulate(stiff, ConstantDuty(0.5), 1.0, start)
    omega = contact_frequency(stiff, state)
    assert parts(stiff, state, 199.5 * 1.2 / omega) == 200
    assert parts(stiff, state, 3.0 * (1.0 + 1e-12) * 1.2 / omega) == 3, "round-off is no part"
    with pytest.raises(SimulationError, match=r"201.*200"):
        parts(stiff, state, 200.5 * 1.2 / omega)


def test_a_drive_whose_steps_miss_the_load_says_so(monkeypatch):
    """As it was before the step was divided."""
    monkeypatch.setattr("rover_pin.simulation.simulate.parts", lambda *_: 1)
    trace = scenario("flat", duration=4.0, **{"soil.k_1": 3e7, "soil.k": 0.01}).drive()
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
    """The cart on a slope with a slip law and a shear so stiff that one step sweeps across it."""
    return scenario(
        "park", rover="cart", form="gross", slip="algebraic", duration=2.0, gravity=11.06,
        **{"soil.k": 0.0006, "soil.phi_deg": 12.7, "soil.k_1": 3.7e6, "start.yaw_deg": -77.0, **settings},
    )  # fmt: skip


def test_shear_stiffer_than_the_step_does_not_shake_wheels_loose():
    """It used to slide by 3.9 m in 4 s; steps 4 and 32 times finer creep by 2.1 mm."""
    drive = park()
    coarse = drive.drive()
    fine = dataclasses.replace(drive, timing=dataclasses.replace(drive.timing, divided=16)).drive()
    for axis in ("body_x", "body_y"):
        assert np.abs(coarse[axis] - fine[axis]).max() < 5e-4


class Rough:
    """A way in time whose forces turn within `span`: a step of `length` there is misjudged by rate length^2."""

    def __init__(self, span, rate, explodes=math.inf):
        self.span, self.rate, self.explodes = span, rate, explodes
        self.t, self.dt, self.error, self.misjudged = np.zeros(1), 64.0, np.zeros(1), 0.0
        self.tried, self.kept = [], []

    def set_step(self, dt):
        self.dt = dt

    def saved(self):
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


def driven(stub, steps=8, commanded=lambda k: k == 0):
    pace = Pace(stub, 64.0)
    assert [pace.advance(commanded(k)) for k in range(steps)] == [0] * steps
    ends = np.cumsum([0.0, *(length for _, length in stub.kept)])
    assert ends[-1] == stub.t[0] == 64.0 * steps
    np.testing.assert_array_equal(ends[:-1], [begin for begin, _ in stub.kept])
    return pace


def test_step_with_mispredicted_forces_is_repeated_in_quarters():
    """Steps of 4 make 0.8 ROUGH where those of 16 make 12.8 ROUGH: none that is worse is kept."""
    stub = Rough((130.0, 200.0), ROUGH / 20.0)
    pace = driven(stub)
    assert pace.missed == 0.0
    assert max(length for begin, length in stub.kept if 130.0 <= begin < 200.0) <= 4.0
    assert [length for begin, length in stub.kept if begin < 64.0] == [64.0]
    assert stub.kept[-1][1] == 64.0
    assert len(stub.tried) > len(stub.kept)


def test_steps_are_as_long_as_asked_where_no_force_turns():
    stub = Rough((0.0, 0.0), 1.0)
    assert driven(stub).missed == 0.0
    assert stub.tried == [64.0] * 8


def test_a_step_before_a_command_is_not_taken_again_but_counted():
    """What comes after it is taken in quarters all the same."""
    stub = Rough((128.0, 192.0), ROUGH / 1000.0)
    pace = driven(stub, commanded=lambda k: True)
    assert (128.0, 64.0) in stub.kept
    assert (192.0, 64.0) in stub.kept
    assert pace.missed == pytest.approx(ROUGH / 1000.0 * 64.0**2 * 64.0)
    assert stub.kept[4][1] == 16.0


@pytest.mark.parametrize(
    ("first", "later", "lengths"),
    [
        (0.0499, 0.0021, [64.0, 64.0]),
        (0.0501, 0.0021, [64.0, 16.0, 16.0, 16.0, 16.0]),
        (0.0501, 0.0019, [64.0, 16.0, 16.0, 32.0]),
    ],
)
def test_step_is_rough_at_0_05_of_the_load_and_calm_at_0_002(first, later, lengths):
    class Told(Rough):
        def step(self):
            super().step()
            self.misjudged = later if len(self.tried) > 1 else first
            return 0

    stub = Told((0.0, 0.0), 0.0)
    driven(stub, 2, commanded=lambda k: True)
    assert stub.tried == lengths


def test_misprediction_of_the_finest_step_counts_by_its_length():
    """Two calm steps of the finest, then one of twice that which is told that the last misjudged its forces."""

    class Told(Rough):
        def step(self):
            super().step()
            self.misjudged = 0.06 if len(self.tried) == 3 else 0.0
            return 0

    stub = Told((0.0, 0.0), 0.0)
    pace = Pace(stub, 64.0)
    pace.go_on(Checkpoint(0.0, 0, 1, 0.5))
    assert pace.advance(True) == 0
    assert stub.tried[:5] == [1.0, 1.0, 2.0, 1.0, 1.0]
    assert pace.missed == pytest.approx(0.5 + 0.06)


def test_a_step_that_explodes_is_taken_again_until_the_finest():
    stub = Rough((100.0, 140.0), 0.0, explodes=2.0)
    assert driven(stub).missed == 0.0
    assert max(length for begin, length in stub.kept if 100.0 <= begin < 140.0) <= 2.0
    assert Pace(Rough((0.0, 1.0), 0.0, explodes=0.0), 64.0).advance() == 1


def test_step_lengths_and_errors_scale_with_the_requested_step():
    """A stub in 64ths of a step that is half as long: the same steps, and half of what is missed."""
    stub = Rough((64.0, 65.0), 2.0 * ROUGH * 4.0)
    pace = Pace(stub, 32.0)
    stub.dt = 32.0
    assert [pace.advance(k == 0) for k in range(8)] == [0] * 8
    assert stub.t[0] == 32.0 * 8
    assert min(stub.tried) == 0.5
    assert max(stub.tried) == 32.0
    assert pace.missed == pytest.approx(2.0 * 0.5 * 2.0 * ROUGH)


def test_step_parts_are_those_of_the_unscaled_soils_by_default():
    model = scenario("flat", **{"soil.k_1": 1e7}).model
    state = settled(model, Start())
    steps = np.linspace(1e-3, 0.1, 60)
    assert [parts(model, state, dt) for dt in steps] == [parts(model, state, dt, 1.0) for dt in steps]
    assert [parts(model, state, dt) for dt in steps] != [parts(model, state, dt, 1.1) for dt in steps]


def test_what_the_finest_steps_misjudge_is_counted():
    stub = Rough((128.0, 130.0), 2.0 * ROUGH)
    assert driven(stub).missed == pytest.approx(2 * 2.0 * ROUGH)


def test_drive_with_forces_faster_than_its_steps_is_remeasured(monkeypatch):
    """A wheel that turns against its travel as fast as it travels, where the slip law jumps: 1 mm at half the step."""
    drive = scenario(
        "hills", form="net", slip="algebraic", duration=4.0, gravity=7.2, gear_friction=0.0178,
        **{"soil.k": 0.0786, "soil.phi_deg": 35.9, "soil.n": 0.958, "soil.k_1": 117154.7, "control.delta": -0.969},
    )  # fmt: skip
    assert drive.drive().attrs["warnings"] == []
    monkeypatch.setattr(half_step, "MOVED", 1e-4)
    monkeypatch.setattr(half_step, "MOVED_SHARE", 0.0)
    reason, *_, told = drive.drive().attrs["warnings"]
    assert "wheels' forces turned" in reason
    trace, finer = (simulate(drive.model, drive.controller, 4.0, drive.start, each) for each in halves(drive.timing))
    moved = np.hypot(trace["body_x"] - finer["body_x"], trace["body_y"] - finer["body_y"]).max()
    assert f" {1e3 * moved:.2g} mm" in told


def halves(timing):
    return timing, timing.halved()


def rows_of(model, count, airborne, duration=3.0):
    """Rows of a rover at rest, some of its wheels off the ground in some of them."""
    rows = np.zeros(count, dtype=row_type(model))
    rows["t"] = np.linspace(0.0, duration, count)
    normal = rows["record"][:, :, RECORD.index("normal")]
    normal[...] = model.gravity * model.built.mass / normal.shape[1]
    normal[airborne] = 0.0
    rows["impulse"] = np.outer(rows["t"], model.built.up) * model.gravity * model.built.mass
    return rows


@pytest.mark.parametrize(
    ("airborne", "share"), [(np.s_[:20, :], ""), (np.s_[:21, :], "35%"), (np.s_[:, :2], ""), (np.s_[:, :3], "50%")]
)
def test_a_rover_that_hops_is_doubted(airborne, share):
    model = scenario("flat").model
    told = [f"the wheels were off the ground {share} of the time"] if share else []
    assert doubts_of(model, rows_of(model, 60, airborne), 0.0) == told


@pytest.mark.parametrize(
    ("slip", "wheels", "count", "share"),
    [
        (-0.11, np.s_[:, :1], 60, "17%"),
        (-0.09, np.s_[:, :6], 60, ""),
        (-0.5, np.s_[:35, :1], 60, ""),
        (-0.5, np.s_[:38, :1], 60, "11%"),
        (0.5, np.s_[:, :], 60, ""),
    ],
)
def test_wheels_braked_for_a_tenth_of_a_drive_cause_a_warning(slip, wheels, count, share):
    model = scenario("flat").model
    rows = rows_of(model, count, np.s_[:0, :])
    rows["record"][:, :, RECORD.index("slip")][wheels] = slip
    told = [f"the wheels were braked beyond S = -0.1 {share} of the time"] if share else []
    assert doubts_of(model, rows, 0.0) == told
    rows["record"][:, :, RECORD.index("normal")] = 1e-3
    assert doubts_of(model, rows, 0.0) == told, "however light the rover"
    rows["record"][:, :, RECORD.index("normal")] = 0.0
    assert not any("braked" in one for one in doubts_of(model, rows, 0.0)), "in the air nothing brakes"


@pytest.mark.parametrize(("duration", "most"), [(20.0, 0.005), (2.0, 0.002)])
def test_misprediction_is_a_speed_change_in_total_and_per_second(duration, most):
    model = scenario("flat", gravity=2.0).model
    rows = rows_of(model, 60, np.s_[:0], duration)
    rows["t"] += 40.0  # of a drive that goes on
    assert doubts_of(model, rows, 0.49 * most) == []
    (doubt,) = doubts_of(model, rows, 0.51 * most)
    assert f"misjudged them by {1.02 * most:.2g} m/s in sum" in doubt


@pytest.mark.parametrize(("load", "told"), [(0.982, True), (0.991, False), (1.009, False), (1.011, True)])
def test_a_mean_load_that_is_not_the_weight_is_told(load, told):
    model = scenario("flat").model
    rows = rows_of(model, 60, np.s_[:0])
    rows["impulse"] *= load
    assert bool(load_warning(model, rows)) is told
    enough = rows_of(model, 60, np.s_[:0], duration=0.51)
    enough["impulse"] *= 2.0
    assert load_warning(model, enough) != ""
    short = rows_of(model, 60, np.s_[:0], duration=0.49)
    assert airborne(rows_of(model, 60, np.s_[:], duration=0.49)) == 0.0
    assert braked(rows_of(model, 60, np.s_[:0])[:0]) == 0.0
    short["impulse"] *= 2.0
    assert load_warning(model, short) == ""


@pytest.mark.parametrize("rise", [0.0, 0.6])
def test_what_carries_more_than_the_weight_speeds_up_the_rover(rise):
    """Newton: I . up = m g T + m dv. What was gained along the slope is no weight."""
    model = scenario("flat").model
    model = dataclasses.replace(model, rover=model.rover.rising(rise, 0.0))
    rows, mass, up = rows_of(model, 60, np.s_[:0]), model.built.mass, model.built.up
    assert mean_load(model, rows) == pytest.approx(1.0)
    gained = np.linspace(0.2, 1.2, 60)
    rows["velocity"] += gained[:, None] * up + np.outer(3.0 * gained, np.cross(up, [0.0, 1.0, 0.0]))
    rows["impulse"] += mass * gained[:, None] * up
    assert mean_load(model, rows) == pytest.approx(1.0)
    rows["impulse"] += 0.3 * np.outer(rows["t"], up) * mass * model.gravity
    assert mean_load(model, rows) == pytest.approx(1.3)
    assert doubts_of(model, rows[:0], 0.0) == []


@pytest.mark.parametrize(("off", "told"), [(0.0099, False), (0.0101, True)])
def test_energy_that_does_not_balance_is_told(off, told):
    trace = scenario("flat", duration=1.0).drive()
    stored = trace["energy_motor"] - trace["energy_motor"][0]
    changed = {"energy_kinetic": 0.0 * stored, "energy_potential": (1.0 - off) * stored}
    rest = {name: 0.0 * stored for name in trace.channels if name.startswith("energy_") and name != "energy_motor"}
    of = dataclasses.replace(trace, channels={**trace.channels, **rest, **changed})
    assert bool(balance_warning(of)) is told
    assert balance_warning(trace) == ""
    two = dataclasses.replace(of, channels={name: values[[0, -1]] for name, values in of.channels.items()})
    assert bool(balance_warning(two)) is told
    assert balance_warning(dataclasses.replace(of, channels={n: v[:1] for n, v in of.channels.items()})) == ""
    rest = 1e-6 * 5.8 * 9.81 * 0.045  # of the weight times a wheel's radius
    for share, heard in ((0.9, False), (1.1, told)):
        tiny = {
            name: share * rest / np.ptp(stored) * values for name, values in of.channels.items() if "energy_" in name
        }
        assert bool(balance_warning(dataclasses.replace(of, channels={**of.channels, **tiny}))) is heard


@pytest.mark.parametrize(("share", "told"), [(0.9, False), (1.1, True)])
def test_energy_at_rest_is_measured_by_the_least_wheel(share, told):
    """Wheels of 45 and 90 mm under 10 N: 1e-6 of 10 N times 45 mm is no energy, and needs no balance."""
    zero, moved = np.zeros(2), np.array([0.0, share * 1e-6 * 10.0 * 0.045])
    channels = {"energy_motor": moved, "energy_kinetic": zero, "energy_potential": zero, "normal_a": zero + 6.0}
    trace = Trace({"t_s": [0.0, 1.0], **channels, "normal_b": zero + 4.0}, attrs={"wheel_radii_m": [0.045, 0.09]})
    trace.attrs["wheels"] = ["a", "b"]
    assert bool(balance_warning(trace)) is told


def test_rows_from_the_first_nonfinite_number_on_are_dropped():
    """A rover that diverges overflows: its trace used to hold NaN."""
    rows = rows_of(scenario("flat").model, 9, np.s_[:0])
    assert len(finite(rows)) == 9
    rows["q"][5, 2], rows["energy"][7, 0] = np.nan, np.inf
    assert len(finite(rows)) == 5
    rows["energy"][0, 1] = -np.inf
    assert len(finite(rows)) == len(finite(rows[:0])) == 0


def test_half_the_step_is_half_of_what_is_taken():
    timing = Timing(0.005)
    assert timing.refined(3).dt == pytest.approx(0.005 / 3)
    assert timing.halved().refined(3).divided == 1, "what is taken is not divided again"
    assert timing.halved().refined(3).dt == pytest.approx(0.005 / 6)
    assert timing.halved().halved().refined(1).dt == pytest.approx(0.00125)
    assert math.isclose(timing.halved().dt, 0.005)


def test_drive_without_rows_or_with_lost_numbers_is_not_good():
    model = scenario("flat").model
    rows = rows_of(model, 60, np.s_[:0])
    assert len(doubts_of(model, rows[:0], 1e-5)) == 1, "no time in which anything may be misjudged"
    rows["impulse"][-1] = np.nan
    assert mean_load(model, rows) == math.inf
    assert "inf times" in load_warning(model, rows)


def test_a_step_is_taken_to_follow_a_command_unless_told():
    class Told(Rough):
        def step(self):
            super().step()
            self.misjudged = float(len(self.tried) == 2)
            return 0

    for commanded, tried in (((), [64.0, 64.0]), ((False,), [64.0, 64.0, 16.0])):
        pace = Pace(Told((0.0, 0.0), 0.0), 64.0)
        assert pace.advance() == pace.advance(*commanded) == 0
        assert pace.stepper.tried[:3] == tried


def test_a_tenth_of_a_second_is_the_coarsest_step():
    assert Timing(0.1, 0.1, 0.1).dt == 0.1
    with pytest.raises(SimulationError, match=r"dt = 0\.101"):
        Timing(0.101, 0.101, 0.101)
