"""Many mutated inputs through the contract, and what broke it."""

import random
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from . import contract, mutations, valid


class Broken(NamedTuple):
    """One input that broke the contract."""

    reader: str
    number: int
    how: str


class Tally(NamedTuple):
    """How often each reader accepted and refused, and what broke the contract."""

    counts: Counter
    broken: list[Broken]


def fuzz(total: int, seed: int = 0, only: str = "", scratch: Path | None = None) -> Tally:
    """Run about `total` inputs, shared among the readers; input i of a reader depends on seed, reader and i alone."""
    with TemporaryDirectory() as folder:
        base = Path(scratch or folder)
        readers = valid.cases(base / "made")
        total_share = sum(reader.share for reader in readers)
        tally = Tally(Counter(), [])
        for reader in readers:
            if only in ("", reader.name):
                # The valid input first, without a limit: imports and compilation do not count as the reader's time, and
                # a limit that ends an import would leave half a module behind.
                reader.lay(base / "input", {})
                reader.read(base / "input")
                _fuzz_reader(reader, round(total * reader.share / total_share), seed, base / "input", tally)
        return tally


def mutant(reader: valid.Case, number: int, seed: int) -> dict[str, bytes]:
    """Return the files that input `number` of a reader changes."""
    rng = random.Random(f"{seed} {reader.name} {number}")
    lines = {"command line": valid.WORDS, "commands": valid.doors.WORDS}.get(reader.name)
    if lines:
        words = mutations.mutated_words(rng.choice(lines).split(), rng)
        return {"words.txt": "\t".join(words).encode()}
    name = rng.choice(reader.victims or tuple(reader.files))
    return {name: mutations.mutated(name, reader.files[name], rng)}


def _fuzz_reader(reader: valid.Case, count: int, seed: int, folder: Path, tally: Tally) -> None:
    for number in range(count):
        reader.lay(folder, mutant(reader, number, seed))
        outcome = contract.outcome(lambda: reader.read(folder))
        tally.counts[reader.name, outcome if outcome in ("accepted", "refused") else "broken"] += 1
        if outcome not in ("accepted", "refused"):
            tally.broken.append(Broken(reader.name, number, outcome))
