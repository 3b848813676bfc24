"""Every reader accepts a mutated input or refuses it by one clear line: a sample here, ten thousand in the slow run."""

import importlib
import importlib.util
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from rover_pin.base.errors import DataError, SimulationError, one_line

HERE = Path(__file__).parent
_spec = importlib.util.spec_from_file_location("fuzz", HERE / "__init__.py")
sys.modules["fuzz"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(sys.modules["fuzz"])
contract, mutations, run, valid = (
    importlib.import_module(f"fuzz.{name}") for name in ("contract", "mutations", "run", "valid")
)
SHOWN = 20
"""Broken inputs that a failure lists; `run.mutant` makes them again from reader, number and seed."""


def assert_kept(tally):
    assert not tally.broken, "\n".join(map(str, tally.broken[:SHOWN]))


def test_what_is_valid_is_accepted(tmp_path):
    for reader in valid.cases(tmp_path / "made"):
        reader.lay(tmp_path / "input", {})
        assert contract.outcome(lambda reader=reader: reader.read(tmp_path / "input")) == "accepted", reader.name


@pytest.mark.parametrize("line", valid.WORDS)
def test_every_command_line_is_accepted(tmp_path, line):
    (tmp_path / "words.txt").write_text("\t".join(line.split()))
    assert contract.outcome(lambda: valid.read_words(tmp_path)) == "accepted"


@pytest.mark.parametrize("line", valid.doors.WORDS)
def test_every_command_on_a_folder_is_accepted(tmp_path, folder, line):
    folder.lay(tmp_path / "input", {"words.txt": "\t".join(line.split()).encode()})
    assert contract.outcome(lambda: folder.read(tmp_path / "input")) == "accepted"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return next(case for case in valid.cases(tmp_path_factory.mktemp("made")) if case.name == "commands")


def test_a_sample_of_inputs(tmp_path):
    tally = run.fuzz(150, seed=1, scratch=tmp_path)
    assert_kept(tally)
    assert sum(tally.counts.values()) > 130


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, 2])
def test_ten_thousand_inputs(tmp_path, seed, capsys):
    """Both seeds together are ten thousand; every reader must have seen good and bad ones."""
    tally = run.fuzz(5010, seed=seed, scratch=tmp_path)
    with capsys.disabled():
        print(
            f"\nseed {seed}: {sum(tally.counts.values())} inputs of {len({name for name, _ in tally.counts})} readers, "
            f"{len(tally.broken)} tracebacks"
        )
    assert_kept(tally)
    for reader in {name for name, _ in tally.counts}:
        assert min(tally.counts[reader, outcome_kind] for outcome_kind in ("accepted", "refused")) > 0, reader


def test_an_input_depends_on_its_number_alone(tmp_path):
    reader = valid.cases(tmp_path / "made")[0]
    assert run.mutant(reader, 7, 0) == run.mutant(reader, 7, 0)
    assert len({str(run.mutant(reader, number, 0)) for number in range(50)}) > 45


def raising(error):
    def read():
        raise error

    return read


def test_the_contract_bites(monkeypatch):
    """A traceback, a warning, a hang, too much memory and a refusal that is no line are all seen."""
    assert contract.outcome(raising(DataError("one line"))) == "refused"
    assert contract.outcome(raising(SimulationError("one line"))) == "refused"
    assert contract.outcome(raising(KeyError("x"))).startswith("KeyError")
    assert contract.outcome(lambda: warnings.warn("x", stacklevel=1)).startswith("UserWarning")
    assert contract.outcome(lambda: np.ones(contract.MEMORY)).startswith("MemoryError")
    broken = DataError("x")
    broken.args = ("two\nlines",)
    assert contract.outcome(raising(broken)).startswith("refusal of 2 lines")
    monkeypatch.setattr(contract, "LONGEST", 0.05)
    assert contract.outcome(lambda: [None for _ in iter(int, 1)]).startswith("Hang")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a\nb\r\nc\n", "a b c"),
        ("names 'm\u00fcll'", "names 'm\u00fcll'"),
        ("bell \x07, turned \u202eround", r"bell \x07, turned \u202eround"),
        ("x" * 5000, "x" * 945 + " ... " + "x" * 250),
    ],
)
def test_whatever_a_message_quotes_it_is_one_printable_line(text, line):
    assert one_line(text) == str(DataError(text)) == str(SimulationError(text)) == line
    assert one_line(line) == line


OPENED = []
"""The files that Python opened while a list of them is kept here."""
sys.addaudithook(lambda event, value: OPENED[-1].append(str(value[0])) if event == "open" and OPENED else None)
WORD = re.compile(r'"([^"\n]*)"')


def named_instead(content, path):
    """Yield a TOML or URDF once for each text in it, which then names a file."""
    for match in WORD.finditer(content.decode()):
        text = content.decode()
        yield match[1], (text[: match.start(1)] + path + text[match.end(1) :]).encode()


@pytest.mark.parametrize("way", ["absolute", pytest.param("relative", marks=pytest.mark.slow)])
def test_whatever_a_file_names_is_opened_in_its_folder_alone(tmp_path, monkeypatch, way):
    """Each text of each valid TOML names a file outside in its turn: none is opened, and none is quoted."""
    secret = tmp_path / "outside" / "secret.csv"
    secret.parent.mkdir()
    secret.write_text("password,hunter2\n1,2\n")
    named_path = str(secret) if way == "absolute" else "../outside/secret.csv"
    tried = 0
    readers = (path for path in valid.cases(tmp_path / "made") if "parquet" not in path.name and path.name != "nexus6")
    for reader in readers:  # those left out name files as others do
        for file, content in reader.files.items():
            for word, changed in named_instead(content, named_path) if file.endswith(".toml") else ():
                reader.lay(tmp_path / "input", {file: changed})
                monkeypatch.chdir(tmp_path / "input")
                OPENED.append([])
                outcome = contract.outcome(lambda reader=reader: reader.read(tmp_path / "input"))
                opened = {Path(path).resolve() for path in OPENED.pop()}
                assert secret not in opened, (reader.name, file, word)
                assert outcome in ("accepted", "refused"), (reader.name, file, word, outcome)
                tried += 1
    assert tried > 100
