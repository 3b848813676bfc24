"""The tail of a message about an unknown name: the near one where there is one, then what is known."""

import pytest

from rover_pin.base.errors import closest

MANY = [f"effect_{number:02d}" for number in range(25)]


@pytest.mark.parametrize(
    ("name", "known", "said"),
    [
        ("phj", ["phi", "k", "n"], "did you mean 'phi'? Known: k, n, phi."),
        ("pid", ["none", "eq9", "limit"], "known are eq9, limit, none."),
        ("anything", [], "there is none."),
        ("zzz", MANY, f"known are {', '.join(MANY[:8])}; 25 in all."),
        ("nonsense", [*MANY, "Grousers"], f"known are {', '.join(['Grousers', *MANY[:7]])}; 26 in all."),
    ],
)
def test_an_unknown_name_is_told_what_is_known_once(name, known, said):
    assert closest(name, known) == said


def test_of_many_names_those_that_are_alike_are_listed():
    said = closest("efect_07", MANY)
    assert "you mean 'effect_07'? Known" in said
    assert said.endswith("; 25 in all.")
    assert said.count("effect_") == 1 + 8
