"""Every effect file: named; floats equal symbols, neutral means absent, all at once make no energy."""

import importlib
import inspect
import pkgutil

import casadi as ca
import numpy as np
import pytest

import rover_pin.effects
from rover_pin import ConstantDuty, Soil, Wheel, scenario, simulate
from rover_pin.base.quantity import quantities
from rover_pin.contact import Contact, Load
from rover_pin.effects.effect import Body, BodyEffect, Drive, Effect, MotorEffect, SensorEffect
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.laws import GEOMETRY, contact_law, numbers, split_law
from rover_pin.simulation.model.effect_files import package_effects, user_effects


def found(kind):
    classes = set()
    for module in pkgutil.iter_modules(rover_pin.effects.__path__):
        members = inspect.getmembers(importlib.import_module(f"rover_pin.effects.{module.name}"), inspect.isclass)
        classes |= {member for _, member in members if issubclass(member, kind) and member is not kind}
    return sorted(classes, key=lambda member: member.__name__)


CONTACT_EFFECTS, MOTOR_EFFECTS, BODY_EFFECTS = found(Effect), found(MotorEffect), found(BodyEffect)


def contacts(rng, count, S=None):
    for _ in range(count):
        slip = rng.uniform(-0.9, 0.9) if S is None else S
        yield Contact(
            S=slip,
            S_y=rng.uniform(-1, 1),
            h=10 ** rng.uniform(-4, -1.8),
            v_x=rng.uniform(0.01, 0.08),
            v_y=rng.uniform(-0.02, 0.02),
            v_n=rng.uniform(-0.05, 0.05),
            rim=rng.uniform(0.01, 0.08),
            x=rng.uniform(0, 2),
            axle=float(rng.integers(0, 3)),
            wheel=Wheel(),
            soil=Soil(),
        )


def act(effect, contact, x):
    """Run all three hooks; return the amended contact's numbers, the load and the rates as one flat tuple."""
    contact = effect.amend(contact, x)
    before = Load(f_t=1.0, f_y=0.1, f_n=8.0, torque=0.05, moment_z=0.002)
    load = before.plus(effect.load(contact, before, x))
    constants = [*contact.wheel.values().values(), *contact.soil.values().values()]
    return (*contact[:9], *constants, *load, *effect.rate(contact, load, x))


def states_of(effect, rng):
    return tuple(rng.uniform(-0.5, 0.5) for _ in effect.states)


def drawn(kind, rng):
    """The effect with each finite-bounded parameter drawn near its default, inside the bounds."""
    effect = kind()
    changes = {}
    for name, quantity in quantities(effect).items():
        value = float(getattr(effect, name)) * rng.uniform(0.7, 1.3)
        changes[name] = min(max(value, quantity.low), quantity.high)
    return effect.replace(**changes)


@pytest.mark.parametrize("kind", CONTACT_EFFECTS, ids=lambda kind: kind.__name__)
def test_floats_equal_symbols(kind):
    rng = np.random.default_rng(1)
    for contact in contacts(rng, 20):
        effect = drawn(kind, rng)
        x = states_of(effect, rng)
        symbols = {name: ca.SX.sym(name) for name in (*Contact._fields[:9], *quantities(effect))}
        xs = tuple(ca.SX.sym(f"x{i}") for i in range(len(x)))
        symbolic = effect.replace(**{name: symbols[name] for name in quantities(effect)})
        shifted = contact._replace(**{name: symbols[name] for name in Contact._fields[:9]})
        out = ca.Function("f", [*symbols.values(), *xs], [ca.vertcat(*map(ca.SX, act(symbolic, shifted, xs)))])
        values = [*contact[:9], *(float(getattr(effect, name)) for name in quantities(effect)), *x]
        assert np.array(out(*values)).ravel() == pytest.approx(
            [float(v) for v in act(effect, contact, x)], rel=1e-12, abs=1e-14
        )


@pytest.mark.parametrize("kind", CONTACT_EFFECTS, ids=lambda kind: kind.__name__)
def test_neutral_values_change_nothing(kind):
    if not kind.neutral:
        pytest.skip("the effect has no neutral values: the paper's own traction, or a slip law")
    rng = np.random.default_rng(2)
    neutral = kind().replace(**kind.neutral)
    for contact in contacts(rng, 20):
        x = tuple(0.0 for _ in neutral.states)
        before = Load(f_t=1.0, f_y=0.1, f_n=8.0, torque=0.05, moment_z=0.002)
        amended = neutral.amend(contact, x)
        assert amended[:9] == pytest.approx(contact[:9])
        assert list(amended.soil.values().values()) == pytest.approx(list(contact.soil.values().values()))
        assert [float(v) for v in neutral.load(amended, before, x)] == pytest.approx([0.0] * 5, abs=1e-15)


def chain_of(effect):
    """A slip law, the paper's traction, and the effect: after them, or in the place of the one it stands for."""
    if type(effect).__name__ == "AlgebraicSlip":
        return [effect, SoilTraction()]
    chain = [
        effect if type(effect) is type(default_effect) else default_effect
        for default_effect in (RelaxedSlip(), SoilTraction())
    ]
    return chain if effect in chain else [*chain, effect]


@pytest.mark.parametrize("kind", CONTACT_EFFECTS, ids=lambda kind: kind.__name__)
def test_the_law_in_two_parts_is_the_whole_law(kind):
    rng = np.random.default_rng(6)
    law = contact_law(chain_of(kind()))
    split = split_law(law, len(GEOMETRY))
    for contact in contacts(rng, 20):
        parameters = numbers(chain_of(drawn(kind, rng)))
        geometry = [getattr(contact, name) for name in GEOMETRY]
        constants = numbers([drawn(Wheel, rng), drawn(Soil, rng)])
        states = rng.uniform(-0.5, 0.5, law.numel_in(1))
        whole_law = np.array(law([*geometry, *constants], states, parameters))
        parts = np.array(split.during(geometry, states, split.before(constants, parameters)))
        assert np.all(np.isfinite(whole_law))
        assert parts == pytest.approx(whole_law, rel=1e-13, abs=1e-300)


@pytest.mark.parametrize("kind", CONTACT_EFFECTS, ids=lambda kind: kind.__name__)
def test_derivatives_equal_central_differences(kind):
    """Of the load by the speeds, as the implicit step uses them, at smooth points."""
    chain = chain_of(kind())
    law, parameters = contact_law(chain), numbers(chain)
    states = np.zeros(law.numel_in(1))
    states[: min(1, len(states))] = 0.2
    contact = np.array([0.006, 0.045, 0.004, 0.01, 0.055, 0.3, 1.0, *numbers([Wheel(), Soil()])])
    out = np.array(law(contact, states, parameters)).ravel()
    for j in range(4):
        step = np.zeros_like(contact)
        step[1 + j] = 1e-6
        ahead, behind = (np.array(law(contact + sign * step, states, parameters)).ravel()[:4] for sign in (1, -1))
        assert out[4 + 4 * j : 8 + 4 * j] == pytest.approx((ahead - behind) / 2e-6, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("kind", MOTOR_EFFECTS, ids=lambda kind: kind.__name__)
def test_motor_effect_is_passive_and_vanishes_at_neutral(kind):
    rng = np.random.default_rng(4)
    for _ in range(50):
        drive = Drive(rng.uniform(-1, 1), rng.uniform(-3, 3), 7.2, 24.0, 3.3)
        x = tuple(rng.uniform(-1, 1) for _ in kind.states)
        neutral = kind().replace(**kind.neutral)
        assert neutral.amend(drive, x) == drive
        assert float(neutral.torque(drive, 0.3, x)) == 0.0
        assert np.all(np.isfinite([float(v) for v in kind().rate(drive, 0.3, x)]))


@pytest.mark.parametrize("kind", [*CONTACT_EFFECTS, *MOTOR_EFFECTS, *BODY_EFFECTS, *found(SensorEffect)])
def test_sizes_and_places_are_quantities_and_none_is_both(kind):
    assert set(kind.neutral) | set(kind.places) <= set(quantities(kind))
    assert not set(kind.neutral) & set(kind.places)


JOINTS = ("rocker_l", "bogie_l", "rocker_r", "bogie_r")


def bodies(rng, count):
    """Bodies with four joints, the first and the third joined by a differential."""
    for _ in range(count):
        angles, rates = rng.uniform(-0.3, 0.3, 4).tolist(), tuple(rng.uniform(-0.5, 0.5, 4).tolist())
        twist, twist_rate = angles[0] + angles[2], rates[0] + rates[2]
        yield Body(*rng.uniform(-0.3, 0.3, 12).tolist(), tuple(angles), rates, rates, twist, twist_rate, JOINTS)


def pushed(effect, body):
    push = effect.push(body)
    return [float(v) for v in (*push[:6], *(push.joints or (0.0,) * 4), push.differential)]


@pytest.mark.parametrize("kind", BODY_EFFECTS, ids=lambda kind: kind.__name__)
def test_body_effect_vanishes_at_neutral_and_stays_finite(kind):
    rng = np.random.default_rng(5)
    neutral = kind().replace(**kind.neutral)
    assert (tuple(neutral.ballast()), neutral.rise(), neutral.frees_differential) == ((0, 0, 0), (0, 0), False)
    for body in bodies(rng, 30):
        assert pushed(neutral, body) == pytest.approx([0.0] * 11, abs=1e-15)
        changes = {name: rng.choice([quantity.low, quantity.high]) for name, quantity in quantities(kind).items()}
        assert np.all(np.isfinite(pushed(kind(**changes), body)))


@pytest.mark.parametrize("kind", BODY_EFFECTS, ids=lambda kind: kind.__name__)
def test_a_body_effect_takes_energy_from_a_body_that_moves(kind):
    """What it gives is no more than what it lets out of its springs: friction, drag and dampers only take."""
    for body in bodies(np.random.default_rng(7), 50):
        push = pushed(kind(), body)
        power = np.dot(push[:6], body[6:12]) + np.dot(push[6:10], body.rates) + push[10] * body.twist_rate
        ahead, behind = (float(kind().stored_energy(moved(body, sign * 1e-6))) for sign in (1, -1))
        assert power + (ahead - behind) / 2e-6 <= 1e-9 * abs(power)


def moved(body, dt):
    """The body as it goes on for dt [s], its attitude left as it is: no effect stores by it."""
    place = [x + dt * v for x, v in zip(body[:3], body[6:9], strict=True)]
    angles = tuple(q + dt * rate for q, rate in zip(body.angles, body.rates, strict=True))
    twist = body.twist + dt * body.twist_rate
    return body._replace(x=place[0], y=place[1], z=place[2], angles=angles, twist=twist)


BASE = scenario("incline", **{"terrain.angle_deg": 4.0, "terrain.start": -3.0}).model


def added_effects():
    """Return every effect that has neutral values and is not in the base model."""
    present = {type(contact_effect) for contact_effect in (*BASE.contact_effects, *BASE.motor_effects)}
    for module in pkgutil.iter_modules(rover_pin.effects.__path__):
        members = inspect.getmembers(importlib.import_module(f"rover_pin.effects.{module.name}"), inspect.isclass)
        for _, kind in members:
            if issubclass(kind, (Effect, MotorEffect, BodyEffect)) and kind.neutral and kind not in present:
                present.add(kind)
                yield kind


def with_all(neutral):
    model = BASE
    for kind in added_effects():
        model = model.having(kind().replace(**kind.neutral) if neutral else kind())
    return model


@pytest.mark.slow  # all effects in one law take half a minute to compile
def test_neutral_effects_leave_a_drive_as_it_is():
    plain, neutral = (simulate(model, ConstantDuty(0.55), 3.0) for model in (BASE, with_all(neutral=True)))
    for name in ("body_x", "body_z", "slip_fl", "torque_rr"):
        assert np.allclose(plain[name], neutral[name], rtol=1e-7, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("duty", [0.55, -0.4])
def test_all_at_once_drive_up_and_down_without_making_energy(duty):
    trace = simulate(with_all(neutral=False), ConstantDuty(duty), 5.0)
    assert np.isfinite(trace["body_x"]).all()
    assert np.abs(trace["body_vx"]).max() < 0.2
    assert trace.energy_error() < 0.01


KINDS = package_effects()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_effect_has_a_human_name_and_a_meaning_in_one_line(kind):
    assert "title" in vars(kind)
    assert 3 < len(kind.title) <= 40
    assert kind.title == kind.title.lower()  # words, no class name
    assert "meaning" in vars(kind)
    assert 20 < len(kind.meaning) <= 100  # fits a line
    assert kind.meaning[0].islower()  # it follows "because"
    assert kind.meaning[-1] not in ".;:"
    assert "\n" not in kind.title + kind.meaning


@pytest.mark.parametrize("acts", ["contact", "motor", "body"])
def test_a_new_effect_begins_with_both(run, acts):
    run("new-effect", "StickySoil", "--acts", acts)
    (kind,) = user_effects("sticky_soil.py")
    assert len(kind.title) > 3
    assert len(kind.meaning) > 10
