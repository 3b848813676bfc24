"""Parquet is an extra: without pyarrow the files are refused with the command that installs it, and the rest works."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def without_pyarrow(code, folder):
    """Run code in an interpreter that has no pyarrow."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    hidden = (
        "import importlib.util, sys\n"
        "sys.modules['pyarrow'] = None\n"
        "import rover_pin.base.files.parquet as parquet, rover_pin.sweep.store as store\n"
        "parquet.find_spec = store.find_spec = lambda name: None\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", hidden + code], cwd=folder, env=env, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout


def test_a_drive_and_its_log_need_no_pyarrow(tmp_path):
    out = without_pyarrow(
        "from rover_pin import scenario\n"
        "from rover_pin.logs.drive_log import load_trace, save_trace\n"
        "trace = scenario('flat', duration=1.0).drive()\n"
        "save_trace(trace, 'log')\n"
        "print(len(load_trace('log')['t_s']) == len(trace['t_s']))\n",
        tmp_path,
    )
    assert out.split() == ["True"]


def test_parquet_without_pyarrow_is_refused_with_the_command(tmp_path):
    out = without_pyarrow(
        "import json\n"
        "from rover_pin import RoverPinError, scenario\n"
        "from rover_pin.logs.drive_log import load_trace, save_trace\n"
        "trace, said = scenario('flat', duration=1.0).drive(), []\n"
        "for work in (lambda: save_trace(trace, 'a.parquet'), lambda: load_trace('a.parquet')):\n"
        "    try:\n"
        "        work()\n"
        "    except RoverPinError as error:\n"
        "        said.append(str(error))\n"
        "print(json.dumps(said))\n",
        tmp_path,
    )
    errors = json.loads(out)
    assert len(errors) == 2
    assert all('pip install "pyarrow' in error for error in errors)
