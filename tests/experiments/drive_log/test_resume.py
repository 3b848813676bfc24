"""What a loop on drive logs keeps for a killed run: plain arrays, the same bytes, and no code."""

import io
import pickle

import numpy as np
import pytest

from rover_pin.base.code_digest import key_of_code
from rover_pin.discrepancy.signature import signatures
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.experiments.drive_log.resume import FOLDER, Memory, digest
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.simulation.model.effect_files import known_effects
from tests.experiments.drive_log import drive_sets


def arrays():
    return {"a": np.arange(6.0).reshape(2, 3), "b": np.array([np.nan, -0.0]), "c": np.zeros((0, 4))}


def refused():
    raise AssertionError("made again")


def same(first, second):
    return first.keys() == second.keys() and all(
        first[name].dtype == second[name].dtype
        and first[name].shape == second[name].shape
        and first[name].tobytes() == second[name].tobytes()
        for name in first
    )


def test_who_stops_the_work_is_told_what_is_kept(tmp_path):
    memory = Memory(tmp_path, "key")
    for notes in ([], [f"1 finished steps are kept in {tmp_path}/{FOLDER}: run the same command again to continue"]):
        with pytest.raises(KeyboardInterrupt) as stop, memory.noting():
            raise KeyboardInterrupt
        assert getattr(stop.value, "__notes__", []) == notes
        memory.cached_arrays((1,), arrays)


@pytest.mark.parametrize("damage", [lambda c: c[:40], lambda c: b"", lambda c: c[:90] + b"\xff" + c[91:]])
def test_a_damaged_step_is_made_again(tmp_path, damage):
    memory = Memory(tmp_path, "key")
    memory.cached_arrays((1,), arrays)
    (file,) = (tmp_path / FOLDER).iterdir()
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(AssertionError, match="made again"):
        memory.cached_arrays((1,), refused)
    assert same(memory.cached_arrays((1,), arrays), arrays())


class Harm:
    """Unpickled, it would write a file."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return (open, (self.path, "w"))


def test_nothing_in_the_folder_is_unpickled(tmp_path):
    """Files as a log's author could plant them: of today's name, and of the name that the first version gave."""
    memory, content = Memory(tmp_path, "key"), io.BytesIO()
    harm = np.empty(1, dtype=object)
    harm[0] = Harm(tmp_path / "harmed")
    np.savez(content, a=harm)
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / f"{digest('key', (1,))}.npz").write_bytes(content.getvalue())
    (tmp_path / FOLDER / "base-key.pickle").write_bytes(pickle.dumps(Harm(tmp_path / "harmed")))
    assert same(memory.cached_arrays((1,), arrays), arrays())
    memory.remove_files()
    assert not (tmp_path / "harmed").exists()


def test_the_key_knows_the_code_of_a_users_effects(tmp_path):
    (tmp_path / "own.py").write_text("a = 1\n")
    before = key_of_code([tmp_path / "own.py"])
    assert before == key_of_code([tmp_path / "own.py"]) != key_of_code([])
    (tmp_path / "own.py").write_text("a = 2\n")
    assert key_of_code([tmp_path / "own.py"]) != before


def test_calibration_and_signatures_are_resumed_without_a_replay(tmp_path, monkeypatch):
    log = read_drive_log(drive_sets.write(tmp_path / "log", runs=2, duration=4.0))
    start = with_spread(base_model(log))

    def through(memory):
        base = drive_sets.calibrated_on(log, start, memory)
        tried = candidates(base.model, base.task.experiment, base.parameters, known_effects())[:6]
        return base, signatures(base, tried)

    full, shifted = through(Memory())
    first, _ = through(Memory(tmp_path, "key"))
    driven = []
    spread = DriveExperiment._spread_tasks

    def counted(self, options, requests):
        driven.extend(requests)
        return spread(self, options, requests)

    monkeypatch.setattr(DriveExperiment, "_spread_tasks", counted)
    base, again = through(Memory(tmp_path, "key"))
    assert len(driven) == 2  # the start, on both runs: of it comes the first noise
    for fit in (full, first):
        assert same({"u": fit.u, "p": fit.predicted, **fit.slopes}, {"u": base.u, "p": base.predicted, **base.slopes})
    assert [fit.amplitudes for fit in shifted] == [fit.amplitudes for fit in again]
    assert all(fit.shift.tobytes() == signature.shift.tobytes() for fit, signature in zip(shifted, again, strict=True))
