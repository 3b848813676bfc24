"""Arguments that say what they are: listed, and refused beyond what they say."""

import inspect
from typing import Annotated

import pytest

from rover_pin.base.arguments import arguments_of, check_arguments, spec
from rover_pin.base.errors import ParameterError

Width = Annotated[float, spec("m", "measured", 0.1, 2.0)]


@check_arguments("thing")
def made(width: Width, plain: float = 9.0, *, count: Annotated[int, spec("", "assumed", 1, 3)] = 2) -> tuple:
    """Return them."""
    return width, plain, count


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ((0.09,), r"thing.width = 0.09.*\[0.1, 2\]"),
        ((float("nan"),), "thing.width = nan"),
        (("wide",), "thing.width = 'wide'"),
        ((True,), "thing.width = True"),
    ],
)
def test_what_is_not_is_refused_by_its_name(value, message):
    with pytest.raises(ParameterError, match=message):
        made(*value)


def test_a_function_says_its_arguments_and_keeps_its_signature():
    arguments = arguments_of(made)
    assert {
        name: (argument.kind, argument.quantity.unit, argument.quantity.high) for name, argument in arguments.items()
    } == {"width": (float, "m", 2.0), "count": (int, "", 3)}
    assert list(inspect.signature(made).parameters) == ["width", "plain", "count"]
    assert made.__doc__ == "Return them."
