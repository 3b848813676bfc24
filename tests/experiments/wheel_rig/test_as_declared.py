"""What a set may leave out or say otherwise: missing cells, a slope for the pull, one speed, lugs, density, SDs."""

import math

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.estimation.numbers import Number
from rover_pin.experiments.wheel_rig.candidates import candidates, rig_kinds
from rover_pin.experiments.wheel_rig.declared import describe_declared
from rover_pin.experiments.wheel_rig.diagnostics import flags
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.identify import identify
from rover_pin.measurements.channel import DrawbarPull
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from studies.shared.rig_fits import calibrated
from tests.oracle import rig_generator as hidden


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A set without a hidden effect, by a generator that shares no code."""
    rig = hidden.Rig("none")
    return hidden.write(tmp_path_factory.mktemp("rig") / "plain", rig, hidden.rig_set(rig, loads=(15.0, 40.0)))


def changed(plain, folder, toml=lambda text: text, points=lambda table: table):
    folder.mkdir()
    (folder / "rig.toml").write_text(toml((plain / "rig.toml").read_text()))
    points(pd.read_csv(plain / "points.csv")).to_csv(folder / "points.csv", index=False)
    return folder


def fitted(data):
    experiment = RigExperiment((data,))
    model = RigModel(data.wheel, data.soil().replace(c=0.0), errors=data.errors)
    return calibrated(experiment, model, experiment.uncertain(model))


# --- missing cells ---------------------------------------------------------------------------------------------------


def with_holes(table):
    """A whole level without sinkage, and single cells of the other channels missing."""
    table.loc[table["level"] == table["level"].iloc[0], "sinkage_m"] = np.nan
    table.loc[[3, 5], "torque_Nm"] = np.nan
    table.loc[7, "drawbar_pull_N"] = np.nan
    return table


def blind(rig, holes):
    """The set whose missing cells have a value that a vast noise makes worthless."""
    full = [np.nan_to_num(channel.measured, nan=float(np.nanmean(channel.measured))) for channel in rig.channels]
    sds = [np.where(channel.has_value, channel.sd, 1e7 * channel.sd) for channel in holes.channels]
    pairs = zip(holes.channels, full, sds, strict=True)
    return RigSet(
        rig.wheel, rig.slip, rig.load, tuple(type(channel)(values, sd) for channel, values, sd in pairs),
        declared=rig.declared, levels=rig.levels,
    )  # fmt: skip


def test_missing_cell_has_no_weight_and_its_row_keeps_others(plain, tmp_path):
    holes = read_rig_set(changed(plain, tmp_path / "holes", points=with_holes))
    worthless = blind(read_rig_set(plain), holes)
    channels = identify(holes).channels
    assert [channel.points for channel in channels] == [int(channel.has_value.sum()) for channel in holes.channels]
    fitted_value, with_worthless = fitted(holes), fitted(worthless)
    assert fitted_value.u == pytest.approx(with_worthless.u, abs=1e-4)


@pytest.mark.slow
def test_the_loop_goes_through_a_set_with_missing_cells(plain, tmp_path):
    folder = changed(plain, tmp_path / "holes", points=with_holes)
    verdict = close_the_loop(folder, out=tmp_path / "out")
    assert verdict.answer.value == "no effect needed"
    first = next(score for score in verdict.scores if score.name == "sinkage").levels[0]
    assert math.isnan(first.before), "a level without sinkage has no error of it"
    assert all(0.7 < residual.rms < 1.4 for residual in verdict.extra.after.residuals)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "no sinkage" in page
    assert ">nan" not in page


# --- a slope in place of the pull ------------------------------------------------------------------------------------


def uphill(table):
    """The same runs as a wheel of weight W on a slope: W^2 = load^2 + pull^2, tan(slope) = pull / load."""
    pull = table.pop("drawbar_pull_N")
    return table.assign(load_N=np.hypot(table["load_N"], pull), slope_rad=np.arctan2(pull, table["load_N"]))


def test_a_slope_is_the_load_across_and_the_pull_along_it(plain, tmp_path):
    slope = 'slope = { value = 0.5, unit = "deg" }'
    flat = read_rig_set(plain)

    def told_so(text):
        return "\n".join(slope if line.startswith("drawbar_pull") else line for line in text.splitlines())

    rig = read_rig_set(changed(plain, tmp_path / "slope", told_so, uphill))
    assert rig.load == pytest.approx(flat.load)
    pull, learnt = (
        next(channel for channel in run.channels if isinstance(channel, DrawbarPull)) for run in (flat, rig)
    )
    assert learnt.measured == pytest.approx(pull.measured)
    assert learnt.sd == pytest.approx(flat.load * math.radians(0.5))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (lambda table: table.assign(slope_rad=0.1), "slope_rad replaces drawbar_pull_N"),
        (lambda table: uphill(table).assign(slope_rad=20.0), "slope_rad reaches 20"),
        (lambda table: uphill(table).rename(columns={"slope_rad": "slope_deg"}), "'slope_deg' is not read"),
    ],
)
def test_what_is_no_slope_is_refused(plain, tmp_path, points, message):
    with pytest.raises(DataError, match=message):
        read_rig_set(changed(plain, tmp_path / "bad", points=points))


# --- one speed -------------------------------------------------------------------------------------------------------


def test_one_speed_gives_the_other_by_the_slip(plain, tmp_path):
    both = read_rig_set(plain).speeds
    for name in ("rim_speed_mps", "travel_speed_mps"):
        folder = changed(plain, tmp_path / name, points=lambda table, name=name: table.drop(columns=name))
        assert read_rig_set(folder).speeds == pytest.approx(both, rel=1e-3)


def test_a_speed_of_the_whole_set_is_declared_in_its_toml(plain, tmp_path):
    def bare(table):
        return table.drop(columns=["rim_speed_mps", "travel_speed_mps"])

    assert read_rig_set(changed(plain, tmp_path / "none", points=bare)).speeds is None

    def told_so(text):
        return text + '\n[speed]\ncarriage = { value = 20.0, unit = "mm/s" }\n'

    data = read_rig_set(changed(plain, tmp_path / "carriage", told_so, bare))
    assert data.speeds[:, 0] == pytest.approx(np.full(data.slip.size, 0.02))
    slip = (data.speeds[:, 1] - data.speeds[:, 0]) / np.maximum(*data.speeds.T)
    assert slip == pytest.approx(data.slip)


def test_wheel_spinning_on_the_spot_does_not_give_its_rim_speed(plain, tmp_path):
    def spot(table):
        return table.assign(slip=1.0).drop(columns="rim_speed_mps")

    with pytest.raises(DataError, match=r"row 1 has slip 1.*travel_speed_mps is 0"):
        read_rig_set(changed(plain, tmp_path / "spot", points=spot))


# --- lugs and sand ---------------------------------------------------------------------------------------------------

LUGS = 'lug_height = { value = 5.0, unit = "mm" }\nlug_width = { value = 3.0, unit = "mm" }\nlug_count = 24\n'
SAND = 'bulk_density = { value = 1.33, unit = "g/cm^3" }\nangle_of_repose = { value = 29.0, unit = "deg" }\n'


def declared(text, wheel="", soil=""):
    return text.replace("[wheel]\n", f"[wheel]\n{wheel}").replace("[soil]\n", f"[soil]\n{soil}")


def test_what_is_declared_presets_the_effects_that_have_it(plain, tmp_path):
    data = read_rig_set(changed(plain, tmp_path / "lugs", lambda text: declared(text, LUGS, SAND)))
    model = RigModel(data.wheel, data.soil())
    tried = {candidate.kind: candidate for candidate in candidates(RigExperiment((data,)), model, rig_kinds())}
    way = 2 * math.pi * (data.wheel.r + 0.0025)
    lugs = tried["LugExcavation"]
    assert lugs.effect.values() == pytest.approx({**LugExcavation().values(), "h_l": 0.005, "filled": 1 - 0.072 / way})
    assert {"LugExcavation.filled", "LugExcavation.length"} == set(lugs.shapes)
    assert tried["Grousers"].effect.h_s == pytest.approx(0.005)
    heap = tried["Bulldozing"]
    assert heap.effect.gamma == pytest.approx(1330.0 * 9.81)
    assert "Bulldozing.gamma" not in heap.shapes, "a measured density is held"
    assert tried["FlankPressure"].effect.phi_f == pytest.approx(math.radians(29.0))
    assert "FlankPressure.phi_f" in tried["FlankPressure"].shapes, "an angle of repose is where a fit starts"
    description = describe_declared(data, [candidate.effect for candidate in tried.values()])
    assert any(line.startswith("bulk_density ") and "Bulldozing.gamma" in line for line in description)
    assert any("lug_height" in line and "LugExcavation.h_l" in line for line in description)
    assert not any("not used" in line for line in description)
    first = describe_declared(data, [ExitAngle()])[0]
    assert first.startswith("lug_height")
    assert "not used" in first


def test_a_wheel_that_is_said_to_be_smooth_has_no_lugs(plain, tmp_path):
    def smooth(text):
        return declared(text, 'surface = "smooth"\n')

    data = read_rig_set(changed(plain, tmp_path / "smooth", smooth))
    model = RigModel(data.wheel, data.soil())
    kinds = {candidate.kind for candidate in candidates(RigExperiment((data,)), model, rig_kinds())}
    undeclared = read_rig_set(plain)
    every = {candidate.kind for candidate in candidates(RigExperiment((undeclared,)), model, rig_kinds())}
    assert every - kinds == {"LugExcavation", "LugGrip", "Grousers"}


@pytest.mark.parametrize(("high", "says"), [(28.9, "sits away from"), (29.1, "agrees with")])
def test_friction_is_held_against_the_angle_of_repose(plain, tmp_path, high, says):
    """The whole interval below it: dry sand's friction is no less."""
    sand = 'angle_of_repose = { value = 29.0, unit = "deg" }\n'
    data = read_rig_set(changed(plain, tmp_path / "sand", lambda text: declared(text, soil=sand)))
    number = Number("soil.phi", "rad", *np.radians([26.0, 24.0, high]), math.nan)
    contradictions = [
        flag for flag in flags(data, data.soil(), 0.06, (number,)) if flag.independent.high > flag.independent.low
    ]
    assert [flag.says.value for flag in contradictions] == [says]


@pytest.mark.parametrize("stiffness", ["k_1 = 9e4", "k_phi = 1.5e6\nk_c = 0.0"])
def test_a_fitted_stiffness_is_held_against_the_declared_one(plain, tmp_path, stiffness):
    """As its exponent goes with it: at another n the two have other units."""
    path = changed(plain, tmp_path / "known", lambda text: declared(text, soil=f"{stiffness}\n"))
    data = read_rig_set(path)
    soil, b = data.soil(), float(data.wheel.b)
    (flag,) = flags(data, soil, b, (Number("soil.k_1", "Pa", 2 * soil.k_1, 1.8 * soil.k_1, 2.2 * soil.k_1, math.nan),))
    assert (flag.name, flag.says.value) == ("K_eff", "sits away from")
    assert flag.independent.low == pytest.approx(float(soil.k_1) / b**soil.n)
    assert flags(data, soil.replace(n=soil.n + 0.1), b, (Number("soil.k_1", "Pa", 1.0, 1.0, 1.0, math.nan),)) == ()


@pytest.mark.slow
def test_wheel_with_declared_lugs_has_a_trench_from_the_start(tmp_path):
    """Its depth is known but for how full the pockets are; what is missing besides is told from it."""
    rig = hidden.Rig(sizes={"lug_trench": 0.006, "rate_dependence": 0.1})
    table = hidden.rig_set(rig, loads=(15.0, 40.0), slips=(0.0, 0.2, 0.4, 0.6, 0.8), repeats=2, speeds=(0.01, 0.04))
    folder = hidden.write(tmp_path / "trench", rig, table)
    told_lugs = changed(folder, tmp_path / "lugs", lambda text: declared(text, "lug_height = 0.005\n"))
    verdict = close_the_loop(told_lugs)
    assert verdict.named == ("RateDependence",)
    numbers = {number.name: number for number in verdict.after.numbers}
    height = numbers["LugExcavation.h_l"]
    assert height.prior == "0.005 +- 0.0015"
    assert height.low < 0.006 < height.high
    assert any("LugExcavation.h_l = 5 mm" in line for line in verdict.extra.declared)
    before = {type(effect).__name__ for effect in verdict.before.model.effects}
    assert before == {"SoilTraction", "LugExcavation"}


def test_a_radius_over_the_lugs_is_read_as_the_rims(plain, tmp_path):
    """The same runs told by the tips: omega and v are the same, r, slip and rim speed are those over the lugs."""
    rim, lug = read_rig_set(plain), 0.004
    r = float(rim.wheel.r)

    def by_tips(table):
        tip = table["rim_speed_mps"] * (r + lug) / r
        slip = (tip - table["travel_speed_mps"]) / np.maximum(tip, table["travel_speed_mps"])
        return table.assign(slip=slip, rim_speed_mps=tip)

    def toml(text):
        text = text.replace(f"r = {{ value = {r}", f"r = {{ value = {r + lug}")
        return declared(text, f"lug_height = {lug}\nr_over_lugs = true\n")

    data = read_rig_set(changed(plain, tmp_path / "tips", toml, by_tips))
    assert data.wheel.r == pytest.approx(r)
    assert data.speeds == pytest.approx(rim.speeds)
    exact = (rim.speeds[:, 1] - rim.speeds[:, 0]) / np.maximum(*rim.speeds.T)
    assert data.slip == pytest.approx(exact)


@pytest.mark.parametrize(
    ("wheel", "soil", "message"),
    [
        ("lug_hight = 0.005\n", "", "'lug_hight' in .wheel.: .* 'lug_height'"),
        ("lug_height = { value = 5.0, unit = 'm' }\n", "", "lug_height = 5 m .* 0 to 1 m"),
        ("r_over_lugs = true\n", "", "r_over_lugs = true needs lug_height"),
        ("r_over_lugs = true\nlug_height = 0.5\n", "", "leaves no rim: lug_height = 0.5 m"),
        ("r_over_lugs = 'yes'\n", "", "r_over_lugs = 'yes'"),
        ("", "bulk_density = 1.33\n", "bulk_density = 1.33 kg/m.3 .* 100 to 1e.04 kg/m.3"),
        ("", "angle_of_repose = 29.0\n", "angle_of_repose = 29 rad .* 0 to 1.047 rad"),
    ],
)
def test_what_cannot_be_lugs_or_sand_is_refused(plain, tmp_path, wheel, soil, message):
    with pytest.raises(DataError, match=message):
        read_rig_set(changed(plain, tmp_path / "bad", lambda text: declared(text, wheel, soil)))


# --- SDs of the soil -------------------------------------------------------------------------------------------------


def test_a_soil_constant_with_an_sd_is_a_prior_of_the_loops_fits(plain, tmp_path):
    """A fit is drawn to what is stated as far as its SD says: all the way, and not at all."""
    free = fitted(read_rig_set(plain)).value("soil.phi")
    value = free + math.radians(5.0)
    ends = {}
    for sd in (1e-5, 10.0):
        prior_lines = f"phi = {{ value = {value}, sd = {sd} }}\nexit_ratio = {{ value = 0.2, sd = 1e-6 }}\n"

        def keep(text, message=prior_lines):
            return "\n".join(line for line in text.splitlines() if not line.startswith(("phi", "exit_ratio"))).replace(
                "[soil]", f"[soil]\n{message}"
            )

        data = read_rig_set(changed(plain, tmp_path / f"sd-{sd}", keep))
        posterior_fit = fitted(data)
        ends[sd] = posterior_fit.value("soil.phi")
        assert posterior_fit.value("soil.exit_ratio") == pytest.approx(0.2, abs=1e-4)
        assert [parameter.name for parameter in posterior_fit.parameters].count("soil.phi") == 1
    assert ends[1e-5] == pytest.approx(value, abs=1e-4)
    assert abs(ends[10.0] - free) < math.radians(1.5)
