"""Changes that no test can notice, because they change no result: file, change as it is told, and the reason."""

EQUIVALENT: dict[tuple[str, str], str] = {}
