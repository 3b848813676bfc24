"""Every way to break a rover's URDF gets one sentence that says what to mend."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.rover import load_rover
from rover_pin.rover.urdf_check import check_urdf

URDF = Path(__file__).parents[2] / "urdf"
TEXT = (URDF / "nexus6.urdf").read_text()
WHEEL_INERTIA = re.search(r'<inertia ixx="0.00017\S+" .*?/>', TEXT).group()
BODY_MASS = '<mass value="2.9"/>'
ROCKER_LIMIT = re.search(r"<limit .*?/>", TEXT).group()
ROCKER_AXIS = '<axis xyz="0 1 0"/>'
SPECK = '<box size="1e-3 1e-3 1e-3"/>'
EXTRA = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><axis xyz="0 1 0"/></joint></robot>'

MAST = (
    '<link name="mast"><inertial><mass value="0.1"/>'
    '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>'
)


def wheel_joint(name: str) -> str:
    return re.search(rf'<joint name="{name}".*?</joint>', TEXT, re.S).group()


def scaled(text: str, pattern: str, factor: float) -> str:
    """Return the text with the numbers in these attributes multiplied."""

    def multiply(match: re.Match) -> str:
        numbers = " ".join(repr(float(word) * factor) for word in match.group(2).split())
        return f'{match.group(1)}"{numbers}"'

    return re.sub(pattern, multiply, text)


def without_inertial(link: str) -> str:
    link_text = re.search(rf'<link name="{link}">.*?</link>', TEXT, re.S).group()
    return TEXT.replace(link_text, re.sub(r"(?s)<inertial>.*?</inertial>", "", link_text))


def swapped(joint: str, old: str, new: str) -> str:
    joint_text = wheel_joint(joint)
    assert old in joint_text
    return TEXT.replace(joint_text, joint_text.replace(old, new))


FAULTS = {
    "cut off": (TEXT[:3000], "XML"),
    "no robot": (TEXT.replace("<robot", "<rover").replace("</robot", "</rover"), "<rover>.*<robot>"),
    "xacro": (TEXT.replace("</robot>", '<xacro:x xmlns:xacro="http://www.ros.org/wiki/xacro"/></robot>'), "xacro"),
    "nameless": (TEXT.replace('<link name="base_link">', "<link>"), "<link>"),
    "no links": ("<robot name='x'/>", "<link>"),
    "word for mass": (TEXT.replace(BODY_MASS, '<mass value="heavy"/>'), "link 'base_link': mass = 'heavy'"),
    "comma": (TEXT.replace(BODY_MASS, '<mass value="2,9"/>'), "'2,9'.*point"),
    "short axis": (TEXT.replace(ROCKER_AXIS, '<axis xyz="0 1"/>', 1), "axis = '0 1'"),
    "short rpy": (TEXT.replace('rpy="0 0 0"', 'rpy="0 0"', 1), "origin rpy = '0 0'"),
    "half inertial": (TEXT.replace(BODY_MASS, ""), "link 'base_link'.*<mass"),
    "missing moment": (TEXT.replace('iyy="0.0209042"', ""), "inertia iyy = 'missing'"),
    "no parent": (TEXT.replace('<parent link="base_link"/>', "", 1), "'rocker_l'.*<parent"),
    "two links": (TEXT.replace("</robot>", '<link name="base_link"/></robot>'), "2 links.*'base_link'"),
    "two wheels": (TEXT.replace("</robot>", '<link name="wheel_fl_link"/></robot>'), "2 links.*'wheel_fl"),
    "two joints": (TEXT.replace('name="wheel_fr"', 'name="wheel_fl"'), "2 joints.*'wheel_fl'"),
    "unknown link": (
        TEXT.replace('<child link="rocker_l_link"/>', '<child link="rocker_l_lnk"/>'),
        "'rocker_l'.*child.*'rocker_l_lnk'.*'rocker_l_link'",
    ),
    "floating": (swapped("rocker_l", "revolute", "floating"), "'rocker_l'.*floating"),
    "prismatic": (swapped("rocker_l", "revolute", "prismatic"), "'rocker_l'.*'prismatic'.*fixed, revolute"),
    "no axis": (TEXT.replace(ROCKER_AXIS, '<axis xyz="0 0 0"/>', 1), "'rocker_l'.*axis.*length 0"),
    "no limit": (TEXT.replace(ROCKER_LIMIT, "", 1), "'rocker_l'.*<limit>"),
    "turned limits": (TEXT.replace('lower="-0.349066"', 'lower="0.5"', 1), "lower = 0.5"),
    "degrees": (TEXT.replace('upper="0.349066"', 'upper="20"', 1), "20 rad.*radians"),
    "mimic of nothing": (
        TEXT.replace('<mimic joint="rocker_l"', '<mimic joint="rocker"'),
        "'rocker_r'.*'rocker'.*'rocker_",
    ),
    "loop": (
        TEXT.replace("</robot>", EXTRA.format("bar", "continuous", "bogie_l_link", "rocker_r_link")),
        r"link 'rocker_r_link' is the child of 2 joints \('rocker_r' and 'bar'\), which closes a loop",
    ),
    "loose link": (TEXT.replace("</robot>", '<link name="lone"/></robot>'), "'base_link', 'lone'.*parent"),
    "ring": (TEXT.replace("</robot>", EXTRA.format("ring", "continuous", "wheel_fl_link", "base_link")), "ring"),
    "ring apart": (
        TEXT.replace("</robot>", '<link name="a"/><link name="b"/></robot>')
        .replace("</robot>", EXTRA.format("ab", "fixed", "a", "b"))
        .replace("</robot>", EXTRA.format("ba", "fixed", "b", "a")),
        "'a'.*'base_link'",
    ),
    "no mass": (TEXT.replace(BODY_MASS, '<mass value="0"/>'), "'base_link'.*mass 0 kg"),
    "no inertial": (without_inertial("bogie_l_link"), "'bogie_l_link'.*<inertial>"),
    "not definite": (TEXT.replace('iyy="0.0209042"', 'iyy="-0.02"'), "positive definite"),
    "triangle": (TEXT.replace('izz="0.0286133"', 'izz="0.2"'), "principal moments.*sum"),
    "millimetres": (scaled(TEXT, '(xyz=)"([^"]*)"', 1000.0), "1000.*millimetres"),
    "no origins": (re.sub(r'xyz="[^"]*"(/> <!-- assumed)', r'xyz="0 0 0"\1', TEXT), "origins"),
    "grams": (scaled(TEXT, '(<mass value=|i[xyz]{2}=)"([^"]*)"', 1000.0), "5800 kg.*0.447 m.*grams"),
    "inches": (scaled(TEXT, '(xyz=)"([^"]*)"', 39.37), "inches.*tonnes"),
    "heavy turning": (
        TEXT.replace(WHEEL_INERTIA, scaled(WHEEL_INERTIA, '(i[xyz]{2}=)"([^"]*)"', 1000.0), 1),
        "'wheel_.*_link'.*inertia.*large.*0.0515 m",
    ),
    "heavy speck": (
        scaled(re.sub("<(?:box|cylinder|sphere) [^>]*/>", SPECK, TEXT), '(i[xyz]{2}=)"([^"]*)"', 1000.0),
        "inertia.*large.* 0.*0.447 m",
    ),
    "light turning": (
        TEXT.replace(WHEEL_INERTIA, scaled(WHEEL_INERTIA, '(i[xyz]{2}=)"([^"]*)"', 1e-3), 1),
        "'wheel_.*_link'.*inertia.*small",
    ),
    "heavy without shape": (
        scaled(re.sub(r"(?s)<(visual|collision)>.*?</\1>", "", TEXT), '(i[xyz]{2}=)"([^"]*)"', 1000.0),
        "inertia.*large.*0.447 m",
    ),
    "fixed wheel": (swapped("wheel_fl", "continuous", "fixed"), "'wheel_fl'.*fixed"),
    "another name": (TEXT.replace('"wheel_fl"', '"wheel_lf"'), "'wheel_fl'.*TOML.*'wheel_"),
    "joint without role": (
        TEXT.replace("</robot>", MAST + "</robot>").replace(
            "</robot>", EXTRA.format("pan", "continuous", "base_link", "mast")
        ),
        "joint 'pan' moves.*no role",
    ),
    "mimic the same way": (TEXT.replace('multiplier="-1"', 'multiplier="1"'), "multiplier 1.*offset 0.*multiplier -1"),
    "sideways wheel": (swapped("wheel_ml", "0 1 0", "1 0 0"), "'wheel_ml'.*about x.*cylinder"),
    "sideways wheel that draws nothing": (
        re.sub("<cylinder [^>]*/>", '<box size=".1 .1 .1"/>', swapped("wheel_ml", "0 1 0", "1 0 0")),
        r"wheel joint 'wheel_ml' turns about \(1 0 0\)",
    ),
    "backward rocker": (swapped("rocker_r", "0 1 0", "0 -1 0"), "multiplier 1.*offset 0.*multiplier -1"),
    "sideways steering": (swapped("steer_fl", "0 0 1", "0 1 0"), "'steer_fl'.*left"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_urdf_gets_a_sentence(write_rover, fault):
    text, words = FAULTS[fault]
    assert text != TEXT
    path = write_rover(text)
    report = check_urdf(path)
    assert not report.ok
    assert any(re.search(words, sentence) for sentence in report.faults), report.faults
    assert all(sentence.startswith("nexus6.urdf: ") and "\n" not in sentence for sentence in report.faults)
    with pytest.raises(UrdfError) as refused:
        load_rover(path)
    assert str(refused.value).startswith(report.faults[0].partition(" Likewise ")[0])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'base = "base_link"',
            'base = "chassis"',
            "base 'chassis' is not the root link of the URDF or fixed to it; write base = \"base_link\"",
        ),
        ('rear = ["wheel_rl", "wheel_rr"]', 'rear = ["wheel_fl", "wheel_rr"]', "joint 'wheel_fl' has 2 roles"),
        ('["wheel_ml", "wheel_mr"]', '["wheel_mr", "wheel_ml"]', "'wheel_mr'.*.left, right."),
        (
            'front = ["wheel_fl", "wheel_fr"]\nmiddle = ["wheel_ml", "wheel_mr"]',
            'middle = ["wheel_ml", "wheel_mr"]\nfront = ["wheel_fl", "wheel_fr"]',
            "axle 'middle'",
        ),
        ('[differential]\npair = "rocker"', "", ".differential."),
    ],
)
def test_a_toml_that_does_not_fit_its_urdf_gets_a_sentence(write_rover, old, new, words):
    layout = (URDF / "nexus6.toml").read_text()
    assert old in layout
    path = write_rover(TEXT, layout.replace(old, new))
    assert any(re.search(words, sentence) for sentence in check_urdf(path).faults)
    with pytest.raises(UrdfError, match=words):
        load_rover(path)
