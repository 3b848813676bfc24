"""The reader of a rig set converts its table; the expected values are computed by hand from the motion of the wheel."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Soil
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.experiments.wheel_rig.declared import describe_declared, preset_candidate, presets
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, join_sets
from rover_pin.measurements.repeats import repeat_groups, repeat_noise
from rover_pin.measurements.rig_physics import suspicions
from rover_pin.measurements.rig_reading import read_rig_set

TOML = """
kind = "wheel-rig"
{top}
[wheel]
r = {{ value = 100, unit = "mm" }}
b = {{ value = 50, unit = "mm" }}
{wheel}
[soil]
{soil}
[noise]
sinkage = {{ value = 1, unit = "mm" }}
{noise}
"""


def rig(folder, points, top="", wheel="", soil="", noise=""):
    folder.mkdir(exist_ok=True)
    (folder / "rig.toml").write_text(TOML.format(top=top, wheel=wheel, soil=soil, noise=noise))
    (folder / "points.csv").write_text(points)
    return read_rig_set(folder)


def test_slip_over_the_tips_of_lugs_becomes_that_of_the_rim(tmp_path):
    """A wheel of 90 mm with lugs of 10 mm turns at 1 rad/s. The table states r = 100 mm and the slips of the
    lug tips.
    """
    omega, travels = 1.0, (0.02, 0.06, 0.09, 0.12)
    tips = [(0.1 * omega - v) / max(0.1 * omega, v) for v in travels]
    rims = [(0.09 * omega - v) / max(0.09 * omega, v) for v in travels]
    table = "slip,load_N,sinkage_m,rim_speed_mps\n" + "".join(f"{slip!r},50,0.01,{0.1 * omega}\n" for slip in tips)
    lugs = 'lug_height = { value = 10, unit = "mm" }\nr_over_lugs = true'
    read = rig(tmp_path / "lugs", table, wheel=lugs)
    assert float(read.wheel.r) == pytest.approx(0.09)
    assert read.slip == pytest.approx(rims, abs=1e-12)
    assert read.speeds[:, 1] == pytest.approx(0.09 * omega)
    assert read.speeds[:, 0] == pytest.approx(travels)


def test_a_slope_is_a_load_across_it_and_a_pull_along_it(tmp_path):
    slopes = np.radians([-10.0, 0.0, 15.0])
    table = "slip,load_N,slope_rad\n" + "".join(f"0.{at},60,{slope!r}\n" for at, slope in enumerate(slopes.tolist()))
    read = rig(tmp_path / "slope", table, noise='slope = { value = 0.5, unit = "deg" }')
    assert read.load == pytest.approx([60 * math.cos(slope) for slope in slopes])
    (pull,) = read.channels
    assert pull.measured == pytest.approx([60 * math.sin(slope) for slope in slopes])
    assert pull.sd == pytest.approx([60 * math.cos(slope) * math.radians(0.5) for slope in slopes])


def test_missing_slips_follow_from_the_speeds_along_the_heading(tmp_path):
    """The carriage moves at 50 mm/s at 30 deg to the wheel's plane, which is 43.3 mm/s along this plane."""
    table = "slip,load_N,sinkage_m,travel_speed_mps,rim_speed_mps,slip_angle_rad\n"
    table += f",50,0.01,0.05,0.08,{math.radians(30)}\n,50,0.01,0.05,0.02,{math.radians(30)}\n"
    read = rig(tmp_path / "speeds", table)
    along = 0.05 * math.sqrt(3) / 2
    assert read.slip == pytest.approx([1 - along / 0.08, 0.02 / along - 1])


def test_bekkers_constants_give_the_pressure_that_they_state(tmp_path):
    """The pressure under a plate of the wheel's width is p(z) = (k_c / b + k_phi) z^n in any units."""
    k_c, k_phi, n, b = 1.4e3, 820e3, 1.2, 0.05
    soil = 'n = 1.2\nk_c = { value = 1.4, unit = "kN/m^(n+1)" }\nk_phi = { value = 820, unit = "kN/m^(n+2)" }'
    read = rig(tmp_path / "bekker", "slip,load_N,sinkage_m\n0,50,0.01\n0.5,50,0.02\n", soil=soil)
    declared = read.soil()
    for z in (0.005, 0.02):
        pressure = (float(declared.k_1) + float(declared.k_2) * b) * (z / b) ** float(declared.n)
        assert pressure == pytest.approx((k_c / b + k_phi) * z**n)
    in_inches = [k * 0.0254 ** (n + power) / 4.4482216152605 for k, power in ((k_c, 1), (k_phi, 2))]
    inches = "n = 1.2\n" + "\n".join(
        f'{name} = {{ value = {value!r}, unit = "lb/in^(n+{power})" }}'
        for name, value, power in zip(("k_c", "k_phi"), in_inches, (1, 2), strict=True)
    )
    again = rig(tmp_path / "inches", "slip,load_N,sinkage_m\n0,50,0.01\n0.5,50,0.02\n", soil=inches).soil()
    assert float(again.k_1) == pytest.approx(float(declared.k_1))


@pytest.mark.parametrize(
    ("top", "g"),
    [("", 9.81), ("gravity = 1.62", 1.62), ('gravity = "mars"', 3.71),
     ('gravity = { value = 162, unit = "cm/s^2", source = "parabolic flight" }', 1.62)],
)  # fmt: skip
def test_gravity_acts_on_masses_and_on_the_weight_of_the_soil(top, g, tmp_path):
    soil = 'bulk_density = { value = 1.5, unit = "g/cm^3" }'
    read = rig(tmp_path / "moon", "slip,load_kg,sinkage_m\n0,4,0.01\n0.5,8,0.02\n", top, soil=soil)
    assert read.load == pytest.approx([4 * g, 8 * g])
    assert presets(read)["gamma"].value == pytest.approx(1500 * g)
    (line,) = (line for line in describe_declared(read, [Bulldozing()]) if line.startswith("gravity"))
    assert ("assumed" in line) == (not top)
    assert any("gravity" in finding.what for finding in read.unread) == (not top)


@pytest.mark.parametrize("gravity", ['"venus"', "0", "-9.81", "true", '{ value = 9.81, unit = "m" }'])
def test_a_gravity_that_is_none_is_refused(gravity, tmp_path):
    with pytest.raises(DataError, match="gravity"):
        rig(tmp_path / "odd", "slip,load_N,sinkage_m\n0,40,0.01\n", f"gravity = {gravity}")


def test_sand_without_a_declared_density_still_weighs_less_on_the_moon(tmp_path):
    """The default gamma corresponds to 1600 kg/m^3 on Earth. Under another gravity, a fit starts from this density and
    has gamma as a free parameter.
    """
    table = "slip,load_N,sinkage_m\n0,4,0.01\n0.5,8,0.02\n"
    moon = rig(tmp_path / "moon", table, 'gravity = "moon"')
    candidate = preset_candidate(Bulldozing(), moon)
    assert candidate.effect.gamma == pytest.approx(1600 * 1.62)
    assert "Bulldozing.gamma" in candidate.shapes
    assert preset_candidate(Bulldozing(), rig(tmp_path / "here", table)).effect.gamma == Bulldozing().gamma


def on_two_bodies(tmp_path, c=0.0):
    """Return the set of a wheel of given mass in sand of cohesion `c`, on Earth and on the Moon."""
    table, density = (
        "slip,load_kg,sinkage_m,drawbar_pull_N,drawbar_pull_sd_N\n0.1,4,0.01,1,1\n0.5,4,0.02,2,1\n",
        "bulk_density = 1500",
    )
    earth = rig(tmp_path / "earth", table, 'name = "earth"', soil=f"{density}\nc = {c}")
    moon = rig(
        tmp_path / "moon", table.replace("0.01,1,", "0.01,1.1,"), 'name = "moon"\ngravity = "moon"', soil=density
    )
    return join_sets([earth, moon])


def test_a_wheel_of_given_mass_sinks_alike_under_any_gravity_in_dry_sand(tmp_path):
    """Dimensional analysis (and Kobayashi et al., 2010): in sand without cohesion, all forces are proportional to g."""
    joint = on_two_bodies(tmp_path)
    model = joint.base_model().having(Bulldozing(gamma=presets(joint.declared)["gamma"].value))
    (earth, moon), g = ((model.of(name), joint.sets[i]) for i, name in enumerate(("earth", "moon"))), 1.62 / 9.81
    here, there = (of.predict(data.load, data.slip) for of, data in (earth, moon))
    assert there.sinkage == pytest.approx(here.sinkage, rel=1e-9)
    assert there.drawbar_pull == pytest.approx(g * here.drawbar_pull, rel=1e-9)
    assert moon[0].records["Bulldozing"].gamma == pytest.approx(1500 * 1.62)


def test_slopes_of_a_joint_fit_hold_under_every_gravity(tmp_path):
    joint = on_two_bodies(tmp_path, c=50.0)
    model = joint.base_model()
    parameters = joint.uncertain(model)
    u = np.array([parameter.u(joint.value(model, parameter.name)) for parameter in parameters])
    exact = joint.sensitivities(model, parameters, u).slopes
    for i, parameter in enumerate(parameters):
        step = 1e-5 * np.eye(len(u))[i]
        up, down = (
            joint.predict(
                [joint.with_values(model, {p.name: p.value(x) for p, x in zip(parameters, at, strict=True)})]
            )[0]
            for at in (u + step, u - step)
        )
        difference = np.nan_to_num((up - down) / 2e-5)
        assert np.nan_to_num(exact[i]) == pytest.approx(difference, abs=1e-6 + 1e-4 * np.abs(difference).max()), (
            parameter.name
        )


def test_a_wheel_pushed_sideways_may_sink_deeper_than_its_axle(tmp_path):
    """A wheel of radius 62.5 mm at a slip angle of 90 deg was measured to sink by 76 mm. At a slip angle of 0 this
    depth is doubted but not refused.
    """
    points = "slip,load_N,sinkage_m,slip_angle_rad\n0,40,0.06,0\n0.1,40,0.126,{angle}\n"
    sideways = rig(tmp_path / "sideways", points.format(angle=math.pi / 2))
    assert not any("axle" in finding.what for finding in suspicions(sideways))
    ahead = rig(tmp_path / "ahead", points.format(angle=0.0))
    assert any("0.126 m in row 2" in finding.what and "axle" in finding.what for finding in suspicions(ahead))
    with pytest.raises(DataError, match=r"row 2.*millimetres"):
        rig(tmp_path / "mm", points.format(angle=math.pi / 2).replace("0.126", "12.6"))


def test_the_noise_of_repeats_is_that_of_the_normal_numbers_that_made_it():
    """Sets have three repeats on eight levels, which are 16 degrees of freedom. The mean of 200 estimates lies within 2
    % of the true SD.
    """
    random = np.random.default_rng(0)
    slip = np.repeat(np.linspace(0.0, 0.7, 8), 3)
    group = repeat_groups(np.repeat(np.arange(8), 3), np.full(24, 50.0), np.zeros(24))
    curve = 20.0 * slip - 2.0
    scattered = slip + random.uniform(-0.005, 0.005, 24)  # slips of repeats differ, and the pull with them
    noise = [
        repeat_noise(20.0 * scattered - 2.0 + random.normal(0.0, 0.02, 24), scattered, group).sd for _ in range(200)
    ]
    assert np.mean(noise) == pytest.approx(0.02, rel=0.05)
    strayed = curve + random.normal(0.0, 0.3, 24)
    strayed[10] += 6.0
    repeat_sd = repeat_noise(strayed, slip, group)
    assert repeat_sd.sd == pytest.approx(0.3, rel=0.5)
    assert 10 in repeat_sd.outlying
    assert repeat_noise(curve, np.arange(24) / 30.0, np.arange(24)) is None


def test_a_rig_without_repeats_shows_no_noise_but_gaps_count_for_nothing():
    group = np.array([0, 0, 1, 1, 2, 2])
    values, slip = np.array([1.0, 1.2, 2.0, 2.4, np.nan, 3.0]), np.repeat([0.0, 0.3, 0.6], 2)
    assert repeat_noise(values, slip, group) is None  # two pairs are left of three
    values[4] = 3.3
    # pairs: d^2 sums to (0.2^2 + 0.4^2 + 0.3^2) / 2 over three degrees of freedom
    assert repeat_noise(values, slip, group).sd == pytest.approx(math.sqrt((0.04 + 0.16 + 0.09) / 2 / 3))


def test_the_base_model_of_a_lunar_set_is_that_of_its_loads(tmp_path):
    """A mass of 5 kg loads a wheel on the Moon by 8.1 N. The base model must equal that of a set with 8.1 N
    on Earth.
    """
    lunar = rig(tmp_path / "a", "slip,load_kg,sinkage_m\n0.1,5,0.004\n0.4,5,0.005\n", 'gravity = "moon"')
    earth = rig(tmp_path / "b", "slip,load_N,sinkage_m\n0.1,8.1,0.004\n0.4,8.1,0.005\n")
    pairs = [RigExperiment((data,)) for data in (lunar, earth)]
    first, second = (experiment.predict([experiment.base_model(Soil())])[0] for experiment in pairs)
    np.testing.assert_allclose(first, second, rtol=1e-9)
