"""The seven answers of the search for missing effects about a model and its data."""

from enum import Enum

from rover_pin.base.errors import ParameterError, closest


class Answer(Enum):
    """The answer of the search for missing effects; docs/loop.md explains the rule for each.

    - NAMED: one effect is missing, and the data determine which.
    - SET: an effect is missing, but several sets of effects remain possible.
    - LIKE: something similar to a known effect is missing; the known effect explains only part of the residual, or
      held-out data contradict the evidence for the effect.
    - INADEQUATE: the base model fits only with parameters far from their declared values, or a plain curve that knows
      no physics predicts the data better.
    - NONE_NEEDED: the residual of the base model is noise.
    - NONE_FITS: the residual exceeds the noise, but no known effect explains it, or each effect that explains it
      predicts held-out data worse than the base model.
    - CANNOT_TELL: something is missing, but the data do not determine even the family of the effect.
    """

    NAMED = "an effect is missing"
    SET = "one of a set of effects is missing"
    LIKE = "like an effect of the list"
    INADEQUATE = "the base model does not describe these data"
    NONE_NEEDED = "no effect needed"
    NONE_FITS = "none of these"
    CANNOT_TELL = "cannot tell"

    @property
    def word(self) -> str:
        """The answer as one word in lower case, for the option --fail-on: "named", "cannot-tell"."""
        return self.name.lower().replace("_", "-")


def answers_named(words: str) -> tuple[Answer, ...]:
    """Return the answers that the text `words` names: words such as "named", separated by commas.

    Raises ParameterError if a word is not an answer; the message lists the closest answers.

    Example: `answers_named("named, set")` gives `(Answer.NAMED, Answer.SET)`.
    """
    answers_by_word = {answer.word: answer for answer in Answer}
    answer_words = [word.strip() for word in words.split(",") if word.strip()]
    for word in answer_words:
        if word not in answers_by_word:
            raise ParameterError(f"'{word}' is not an answer of the loop: {closest(word, answers_by_word)}")
    return tuple(answers_by_word[word] for word in answer_words)
