"""What a command assumes: compared with the numbers of the model that it uses, and with what its user gave."""

import csv
import json
from pathlib import Path

import pytest

from rover_pin import scenario
from rover_pin.base.quantity import quantities
from rover_pin.scenarios.assumptions import Assumption, most_decisive
from rover_pin.sweep import read_study
from rover_pin.sweep.case import scenario_of

STUDY = """
name = "small"
scenario = "flat"
duration = 0.5
plan = { kind = "grid" }
[parameters]
"soil.k" = { values = [5, 8], unit = "mm" }
"""
MINIMAL = {
    "drive": ["drive", "flat", "--set", "duration=0.5"],
    "bounds": ["bounds"],
    "curve": ["curve"],
    "map": ["map", "flat", "--set", "duration=0.5", "--headings", "1", "--workers", "1"],
    "export-c": ["export-c", "flat"],
    "export-fmu": ["export-fmu", "flat"],
    "export-mjcf": ["export-mjcf", "flat"],
}
"""Name of a command -> its command line with the minimal input."""


def numbers_in(model):
    """Return every number of a model's soil, motor and effects: name of the setting -> value."""
    records = {"soil": model.soils[0], "motor": model.motor}
    records |= {f"effect.{type(effect).__name__}": effect for effect in model.all_effects}
    pairs = [(owner, name, record) for owner, record in records.items() for name in quantities(record)]
    return {f"{owner}.{name}": float(getattr(record, name)) for owner, name, record in pairs}


def answered(run, words):
    code, out, err = run(*words, "--json")
    assert code == 0, err
    return {entry["name"]: entry for entry in json.loads(out)["assumptions"]}


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"soil.k": 0.005, "soil.phi_deg": 30.0, "motor.k_t": 0.02},
        {"rover": "cart", "effect.MotionResistance.R": 0.1},
        {"soil": "dry-sand", "control": "eq9", "control.S_d": 0.2},
        {"side": "combined", "add": ("GearFriction.tau_c=0.01",)},
    ],
    ids=lambda given: ",".join(given) or "nothing",
)
def test_every_number_of_the_model_is_given_or_listed_as_assumed(given):
    drive = scenario("incline", **given)
    listed = {entry.name: entry.value for entry in drive.assumptions}
    stated = {name.removesuffix("_deg") for name in given}
    for name, value in numbers_in(drive.model).items():
        if name not in stated:
            assert listed[name] == pytest.approx(value, nan_ok=True), name
    assert not stated & listed.keys()


def test_a_model_file_states_its_numbers():
    listed = {entry.name for entry in scenario("flat", model="studies/results/steepening-slope/model.toml").assumptions}
    assert not [name for name in listed if name.startswith(("soil.", "motor.", "effect."))]
    assert {"duration", "control.delta"} <= listed


@pytest.mark.parametrize("command", MINIMAL)
def test_a_command_lists_what_its_user_did_not_give(run, command):
    """A number that is given then leaves the list, and no other does."""
    before = answered(run, MINIMAL[command])
    assert {"value", "unit", "sd", "source"} <= before["soil.phi"].keys()
    assert all(entry["source"] for entry in before.values())
    folder = [] if command == "bounds" else ["--out", "second"]
    after = answered(run, [*MINIMAL[command], "--set", "soil.phi=31deg", *folder])
    assert before.keys() - after.keys() == {"soil.phi"}
    assert after.keys() <= before.keys()


def test_a_sweep_assumes_everything_but_its_axes(run):
    Path("small.toml").write_text(STUDY)
    listed = answered(run, ["sweep", "small.toml", "--workers", "1"])
    study = read_study(Path("small.toml"))
    numbers = numbers_in(scenario_of(study, study.cases()[0]).model)
    assert numbers.keys() - listed.keys() == {"soil.k"}
    # R follows from the soil, which differs between the drives.
    assert listed["effect.MotionResistance.R"]["value"] == "differs between drives"


def test_the_influence_is_the_change_by_one_standard_deviation(run):
    """Repeated by hand for the soil's k, with the derived motion resistance held."""
    listed = answered(run, ["drive", "flat", "--set", "duration=2"])
    entry, R = listed["soil.k"], listed["effect.MotionResistance.R"]["value"]

    def travelled(k):
        settings = {"duration": 2.0, "soil.k": k, "effect.MotionResistance.R": R}
        return scenario("flat", **settings).drive(measure_error=False).summary()["distance_m"]

    change = travelled(entry["value"] + entry["sd"]) - travelled(entry["value"])
    assert entry["influence"]["distance_m"] == pytest.approx(change, rel=1e-9)
    assert change < 0.0
    # The most decisive number comes first, in JSON and in the file.
    sizes = [abs(other["influence"].get("distance_m", 0.0)) for other in listed.values()]
    assert sizes == sorted(sizes, reverse=True)
    with open("out/drive/assumed.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == list(listed)
    assert abs(float(rows[0]["change_of_distance_m"])) == pytest.approx(sizes[0])


def test_a_change_within_the_step_error_is_not_printed():
    """A controller that estimates the slip with particles can amplify rounding; such changes say nothing."""
    entries = [
        Assumption(name, 1.0, "", 0.1, "assumed", {"distance_m": change})
        for name, change in (("a", 0.02), ("b", -0.05), ("c", 0.0))
    ]
    printed = [sentence.split(" = ")[0] for sentence in most_decisive(entries, "distance_m", "m", 0.03)]
    assert printed == ["b"]
    assert [sentence.split(" = ")[0] for sentence in most_decisive(entries, "distance_m", "m")] == ["b", "a"]


def test_only_the_numbers_with_a_known_spread_have_an_influence(run):
    for entry in answered(run, MINIMAL["drive"]).values():
        assert bool(entry["influence"]) == bool(entry["sd"])


def test_the_source_of_a_derived_number_names_its_origin():
    """Such a number differs from the default of its record, although nobody gave it."""
    sources = {entry.name: entry.source for entry in scenario("flat", rover="cart").assumptions}
    assert "cruise_slip" in sources["effect.MotionResistance.R"]
    assert not [name for name, source in sources.items() if name.startswith(("soil.", "motor.")) and "given" in source]


def test_a_user_s_own_control_is_not_run_again(run):
    """Its code may have effects outside the drive, so that no drive is added to find influences."""
    Path("mine.py").write_text(
        "def controller(model):\n    with open('made.txt', 'a') as file:\n        file.write('made ')\n"
        "    return lambda reading: 0.5\n"
    )
    listed = answered(run, [*MINIMAL["drive"], "--control", "mine.py"])
    assert Path("made.txt").read_text().split() == ["made"]
    assert not any(entry["influence"] for entry in listed.values())
