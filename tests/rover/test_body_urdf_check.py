"""Checking a rover's URDF: what is sound, what is only noted, and the two cross_check."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.rover.description import cross_check
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.rover.urdf_check import UrdfReport, check_urdf

URDF = Path(__file__).parents[2] / "urdf"
TEXT = (URDF / "nexus6.urdf").read_text()
ROCKER_LIMIT = re.search(r"<limit .*?/>", TEXT).group()
MESH = '<mesh filename="package://x/y.stl"/>'


@pytest.fixture(autouse=True)
def nothing_remembered(tmp_path, monkeypatch):
    """Every test reads with both readers again."""
    monkeypatch.setenv("ROVER_PIN_CACHE", str(tmp_path / "own_cache"))


@pytest.mark.parametrize("name", ["nexus6.toml", "nexus6.urdf", "cart.toml", "cart.urdf"])
def test_the_rovers_that_come_along_have_no_faults(name):
    report = check_urdf(URDF / name)
    assert report.ok
    assert report.facts
    assert all("without a TOML" in note for note in report.notes)


def test_a_report_says_what_the_rover_is():
    full, alone, cart = (check_urdf(URDF / name) for name in ("nexus6.toml", "nexus6.urdf", "cart.toml"))
    wheels = "wheel_fl, wheel_fr, wheel_ml, wheel_mr, wheel_rl, wheel_rr"
    assert f"6 wheels: {wheels}" in full.facts
    assert "differential: rocker_l and rocker_r" in full.facts
    assert "differential: none" in cart.facts
    (joints,) = (fact for fact in alone.facts if fact.startswith("joints that turn fully: "))
    assert sorted(joints.partition(": ")[2].split(", ")) == sorted(wheels.split(", "))
    assert (full.loads, alone.loads) == (True, False)
    assert not UrdfReport("x.urdf", (), (), ()).loads
    assert [any("without a TOML" in note for note in check_report.notes) for check_report in (full, alone)] == [
        False,
        True,
    ]
    assert "rover file" in check_urdf(URDF / "none.yaml").faults[0]


def test_a_urdf_alone_needs_a_wheel(tmp_path):
    (tmp_path / "sledge.urdf").write_text(TEXT.replace('type="continuous"', 'type="fixed"'))
    report = check_urdf(tmp_path / "sledge.urdf")
    (fault,) = report.faults
    assert "no wheel" in fault


def test_what_cannot_be_read_is_the_reports_one_fault(tmp_path):
    assert "none.urdf: " in check_urdf(tmp_path / "none.urdf").faults[0]
    assert "rover file" in check_urdf(tmp_path / "none.toml").faults[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (TEXT.replace('<sphere radius="0.012"/>', MESH), "1 of 1 meshes are not drawn.*package://x/y.stl"),
        (TEXT.replace(ROCKER_LIMIT, ROCKER_LIMIT + '<dynamics damping="0.1"/>', 1), "'rocker_l' has <dynamics>"),
        (TEXT.replace('<origin xyz="0 0.12 0"/>', '<origin xyz="0.01 0.12 0"/>'), "symmetric"),
        (TEXT.replace('<origin xyz="0.075 0.04 -0.03"/>', '<origin xyz="0.075 0.04 -0.05"/>'), "one plane"),
    ],
)
def test_notes_do_not_keep_a_rover_from_loading(write_rover, text, words):
    assert text != TEXT
    path = write_rover(text)
    report = check_urdf(path)
    assert report.ok
    assert any(re.search(words, note) for note in report.notes), report.notes
    assert load_rover(path).mass == pytest.approx(5.8)


def test_two_readers_that_disagree_are_told_apart(write_rover, monkeypatch):
    """Here by a Pinocchio that is handed one other angle: no URDF known to us makes them differ."""
    honest = cross_check.pin.integrate

    def crooked(model, q, v):
        turned = v.copy()
        turned[model.joints[model.getJointId("rocker_r")].idx_v] += 0.1
        return honest(model, q, turned)

    monkeypatch.setattr(cross_check.pin, "integrate", crooked)
    faults = check_urdf(write_rover(TEXT)).faults
    assert len(faults) == 1
    assert "place link 'rocker_r_link'" in faults[0]


@pytest.mark.parametrize(("reader", "words"), [("yourdfpy", "yourdfpy cannot"), ("pin", "Pinocchio cannot")])
def test_a_reader_that_fails_is_named(write_rover, monkeypatch, reader, words):
    def fails(*_, **__):
        raise ValueError("no")

    if reader == "yourdfpy":
        import yourdfpy

        monkeypatch.setattr(yourdfpy.URDF, "load", fails)
    else:
        import pinocchio

        monkeypatch.setattr(pinocchio, "buildModelFromXML", fails)
    assert words in check_urdf(write_rover(TEXT)).faults[0]


def test_a_rover_that_cannot_stand_is_told(write_rover):
    """Without a differential the two rockers are free pivots: the body swings round, and no load balances it."""
    layout = (URDF / "nexus6.toml").read_text().split("[differential]")[0]
    path = write_rover(re.sub("<mimic[^>]*/>", "", TEXT), layout)
    report = check_urdf(path)
    assert not report.ok
    (fault,) = report.faults
    assert "suspension stays" in fault
    with pytest.raises(ParameterError, match=r"cannot.*wheels"):
        wheel_loads(load_rover(path), 0.02)


def test_a_rover_that_tips_over_is_told(tmp_path):
    """The chassis' centre of mass 0.4 m behind the rear axle."""
    text = (URDF / "cart.urdf").read_text()
    shifted_text = re.sub(
        r'(<link name="chassis">.*?<inertial>\s*<origin xyz=")[^"]*', r"\g<1>-0.8 0 0.1", text, flags=re.DOTALL
    )
    assert shifted_text != text
    (tmp_path / "cart.urdf").write_text(shifted_text)
    shutil.copy(URDF / "cart.toml", tmp_path)
    (fault,) = check_urdf(tmp_path / "cart.toml").faults
    assert re.search(r"wheels fl, fr.* \(-49[.0-9]* N\)", fault)
