"""A drafted effect in its two forms: the object that the loop tries, and the source that it writes for the user."""

import dataclasses
from pathlib import Path

import numpy as np

from rover_pin.simulation.model.effect_files import user_effects


def effect_in(text: str, folder: Path):
    """The effect that a draft's source defines, read as a user's file is."""
    file = folder / f"draft_{len(list(folder.iterdir()))}.py"
    file.write_text(text, encoding="utf-8")
    (kind,) = user_effects(file)
    return kind()


def numbers(answer):
    """All numbers of what a hook returns."""
    if dataclasses.is_dataclass(answer):
        return numbers(tuple(getattr(answer, field.name) for field in dataclasses.fields(answer)))
    if isinstance(answer, dict):
        return numbers(tuple(answer.values()))
    if isinstance(answer, (tuple, list)):
        return [number for part in answer for number in numbers(part)]
    if isinstance(answer, (str, bool)) or answer is None:
        return []
    return np.ravel(np.asarray(answer, dtype=float)).tolist()


class SameLaw:
    """Calls a hook of the object and of the source's effect, and asserts that both answer alike, to the last bit."""

    def __init__(self, drafted, code):
        self.drafted, self.written = drafted, code
        assert type(drafted).__name__ == type(code).__name__
        assert drafted.values() == code.values()
        assert (drafted.neutral, drafted.title, drafted.meaning) == (code.neutral, code.title, code.meaning)
        assert getattr(drafted, "states", ()) == getattr(code, "states", ())

    def __getattr__(self, name):
        hooks = getattr(self.drafted, name), getattr(self.written, name)
        if not callable(hooks[0]):
            return hooks[0]

        def call(*arguments):
            answers = [hook(*arguments) for hook in hooks]
            assert numbers(answers[0]) == numbers(answers[1])
            return answers[0]

        return call
