"""What a busy person reads: one sentence, one picture, why to believe it, why to doubt it, what to drive next."""

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.headline import headline, improvement
from rover_pin.report.reasons import MAX_REASONS, next_run, opposing_reasons, supporting_reasons
from rover_pin.report.section import Picture, Section
from rover_pin.report.words import Labels, capital, human, kinds_of


def first_screen(verdict: Verdict, labels: Labels, picture: Picture | None = None, file: str = "first") -> Section:
    """Return the first screen of any verdict; of more reasons than fit it says how many stand further below.

    `picture` shows what was measured, before and after; `file` is the name of its file.
    """
    why, but = supporting_reasons(verdict, labels), opposing_reasons(verdict, labels)
    content = {
        "file": file,
        "sentence": headline(verdict, labels),
        "improvement": improvement(verdict, labels),
        "answer": capital(verdict.answer.value),
        "said": capital(human(verdict.sentence, kinds_of(verdict))),
        "added": bool(verdict.named),
        "believe": why[:MAX_REASONS],
        "doubt": but[:MAX_REASONS],
        "more": max(len(but) - MAX_REASONS, 0),
        "next": next_run(verdict),
    }
    return Section("Verdict", "first_screen.html", content, {file: picture} if picture is not None else {})


def first_lines(verdict: Verdict, labels: Labels) -> str:
    """Return the first screen as text, for a terminal."""
    parts = {
        "believe it because": supporting_reasons(verdict, labels)[:MAX_REASONS],
        "doubt it because": opposing_reasons(verdict, labels)[:MAX_REASONS],
        "next": next_run(verdict),
    }
    lines = [line for line in (headline(verdict, labels), improvement(verdict, labels)) if line]
    for head, reasons in parts.items():
        lines += [f"{head}:", *(f"  - {line}" for line in reasons)] if reasons else []
    return "\n".join(lines)
