"""What may be said of a model, and how a verdict is put into plain values and lines."""

import math
from enum import Enum
from typing import Any

from rover_pin.base.errors import ParameterError, closest
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.estimation.wording import format_value


class Answer(Enum):
    """What may be said of the model."""

    NAMED = "an effect is missing"
    SET = "one of a set of effects is missing"
    LIKE = "like an effect of the list"
    INADEQUATE = "the base model does not describe these data"
    NONE_NEEDED = "no effect needed"
    NONE_FITS = "none of these"
    CANNOT_TELL = "cannot tell"

    @property
    def word(self) -> str:
        """The answer as one word, as an option takes it."""
        return self.name.lower().replace("_", "-")


def answers_named(words: str) -> tuple[Answer, ...]:
    """Return the answers that stand in a list separated by commas, by their words.

    Raises ParameterError: a word that is no answer.
    """
    answers_by_word = {answer.word: answer for answer in Answer}
    answer_words = [word.strip() for word in words.split(",") if word.strip()]
    for word in answer_words:
        if word not in answers_by_word:
            raise ParameterError(f"'{word}' is no answer of the loop: {closest(word, answers_by_word)}")
    return tuple(answers_by_word[word] for word in answer_words)


def plain(value: Any) -> Any:
    """Return nested values with NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(element) for key, element in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(element) for element in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def score_line(score: ChannelScore) -> str:
    """Return one channel's held-out error, before and after where that is not the same."""
    change, noise = score.worded, f"noise {format_value(score.floor, score.unit)}"
    if change.none:
        return f"held-out {score.name}: RMSE {format_value(score.before, score.unit)}, {noise}"
    errors = f"RMSE {format_value(score.before, score.unit)} -> {format_value(score.after, score.unit, score.before)}"
    return f"held-out {score.name}: {errors} ({change.text}, {noise}): {score.claim}"
