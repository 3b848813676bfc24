"""Whatever a user's controller raises is one sentence with its file and line."""

import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.trust import Trust
from rover_pin.scenarios.scenario import scenario

RAISED = ("GeneratorExit", "SystemExit(3)", "RecursionError('deep')", "MemoryError()", "BaseException('x')")


@pytest.mark.parametrize("raised", RAISED)
@pytest.mark.parametrize("place", ["import", "make", "call", "reset"])
def test_it_is_named_with_its_line(tmp_path, raised, place):
    lines = ["class Hold:", "    def reset(self): pass", "    def __call__(self, reading): return 0.2"]
    lines += ["def controller(model): return Hold()", ""]
    at = {"import": 4, "make": 3, "call": 2, "reset": 1}[place]
    lines[at] = f"raise {raised}" if place == "import" else lines[at].partition(":")[0] + f": raise {raised}"
    file = tmp_path / "mine.py"
    file.write_text("\n".join(lines))
    with pytest.raises(DataError, match=rf"mine.py, line {at + 1}: .*{raised.partition('(')[0]}"):
        scenario("flat", rover="cart", control=str(file), trust=Trust.of(str(file)), duration=0.05).drive()
