"""Names that no file can have, a full disk and entries of another type: one sentence, at every command."""

import errno
import os
from pathlib import Path

import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.files.journal import Journal
from rover_pin.base.files.whole_file import replace_file, write_whole
from rover_pin.base.jobs.safe_environment import SAFE_PATH
from rover_pin.demo import rig
from rover_pin.sweep import store

LONG = "x" * 300
READ = (
    "import-log",
    "new-rover",
    "view",
    "export",
    "sweep",
    "tune",
    "check-urdf",
    "check-data",
    "close-loop",
    "identify",
)
LINES = [
    *(f"{command} {LONG}" for command in READ),
    f"init {LONG} --r 1mm --b 1mm",
    f"compare {LONG} {LONG}",
    f"drive {LONG}",
    f"new-effect {'A' * 300}",
    *(f"{line} --out {LONG}" for line in ("drive flat", "demo rig", "curve", "init set/points.csv --r 60mm --b 50mm")),
    *(f"drive flat {word}" for word in (f"--model {LONG}", f"--set rover={LONG}", f"--soil {LONG}", f"--set {LONG}=1")),
    f"close-loop set --experiment {LONG}",
    f"close-loop set --effects {LONG}",
]


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.replace(LONG, "LONG").replace("A" * 300, "LONG"))
def test_a_name_of_300_letters_is_one_sentence(line, run):
    rig.write(Path("set"), "nothing", 0)
    code, out, err = run(*line.split())
    assert (code, out) == (2, "")
    assert err.startswith("rover-pin: ")
    assert err.count("\n") == 1


STUDY = """
name = "small"
scenario = "flat"
duration = 0.1
plan = { kind = "grid", points = 4 }
[parameters]
soil.k = { low = 1e-3, high = 1e-2 }
"""


def test_a_full_disk_in_a_sweep_keeps_what_is_done(run, monkeypatch):
    Path("study.toml").write_text(STUDY)
    entries, append = [], Journal.append

    def full(journal, entry):
        if len(entries) == 2:
            with journal.file.open("a") as file:
                file.write('{"case": 2, "rep')
            raise OSError(errno.ENOSPC, "No space left on device")
        entries.append(entry)
        append(journal, entry)

    monkeypatch.setattr(Journal, "append", full)
    code, _, err = run("sweep", "study.toml", "--workers", "1")
    assert code == 2
    assert "results cannot" in err
    assert "sweep again" in err
    assert len(store.collect("out/small")) == 2
    monkeypatch.setattr(Journal, "append", append)
    code, out, _ = run("sweep", "study.toml", "--workers", "1", "--json")
    assert code == 0
    assert '"cases": 4, "taken_over": 2, "failed": 0' in out


@pytest.mark.slow
def test_a_full_disk_beside_worker_processes_is_one_sentence(run, monkeypatch):
    def full(journal, entry):
        raise OSError(errno.ENOSPC, "No space left on device")

    Path("study.toml").write_text(STUDY.replace("points = 4", "points = 12"))
    monkeypatch.setattr(Journal, "append", full)
    before = os.environ.get(SAFE_PATH)
    code, _, err = run("-q", "sweep", "study.toml", "--workers", "2")
    assert (code, err.count("\n")) == (2, 1)
    assert "space left" in err
    assert os.environ.get(SAFE_PATH) == before, "the workers' path of modules is theirs alone"


def test_a_full_disk_leaves_no_half_of_a_file(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("rover_pin.base.files.whole_file.os.fsync", full)
    with pytest.raises(OSError, match="space left"):
        write_whole(tmp_path / "part.parquet", "half")
    with pytest.raises(DataError, match=r"part\.parquet.*space left"):
        replace_file(tmp_path / "part.parquet", "half")
    assert list(tmp_path.iterdir()) == []


def test_any_other_refusal_of_the_system_is_a_sentence(run, monkeypatch):
    def full(*value, **named):
        raise OSError(errno.ENOSPC, "No space left on device", "traction.png")

    monkeypatch.setattr("rover_pin.plot.traction_figure", full)
    code, _, err = run("curve")
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("rover-pin: traction.png: ")


@pytest.mark.parametrize("scenario", ['["flat"]', "3", "{ a = 1 }", "[]"])
def test_a_scenario_that_is_no_name_is_refused_before_any_folder(scenario, run):
    Path("study.toml").write_text(STUDY.replace('"flat"', scenario))
    code, _, err = run("sweep", "study.toml")
    assert code == 2
    assert "scenario." in err
    assert not Path("out").exists()


TUNING = 'name = "t"\n[free]\nk_p = [0.01, 10.0]\n[[training]]\nname = "a"\nscenario = "ditch"\n'


@pytest.mark.parametrize("entry", ["free = [1]", "before = [1]", "cost = [1]", "effort = []", "before = 3"])
def test_a_list_for_a_table_of_a_tuning_file_is_refused(entry, run):
    text = TUNING.replace("[free]\nk_p = [0.01, 10.0]\n", "") if entry.startswith("free") else TUNING
    Path("study.toml").write_text(f"{entry}\n{text}")
    code, _, err = run("tune", "study.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert "table" in err


@pytest.mark.parametrize("entry", ['name = "t"', 'name = "a"', 'scenario = "ditch"'])
def test_a_list_for_a_name_of_a_tuning_file_is_refused(entry, run):
    key, _, value = entry.partition(" = ")
    Path("study.toml").write_text(TUNING.replace(entry, f"{key} = [{value}]"))
    code, _, err = run("tune", "study.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert f"{key} = ['{value[1:-1]}']" in err


@pytest.mark.parametrize("link", ["tyre_lf", "tyre_rb", "chassis"])
def test_a_joint_whose_link_is_missing_is_named(link, run):
    import re

    from rover_pin.rover.description.layout import rover_folder

    text = (rover_folder() / "cart.urdf").read_text(encoding="utf-8")
    Path("mine.urdf").write_text(re.sub(rf'<link name="{link}".*?</link>', "", text, flags=re.DOTALL))
    code, _, err = run("new-rover", "mine.urdf")
    assert (code, err.count("\n")) == (2, 1)
    assert f"link '{link}'" in err
    assert not Path("mine.toml").exists()
