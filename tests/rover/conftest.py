"""Rovers and random states for the tests of the rigid body."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.rover.rover import Rover, load_rover

HERE = Path(__file__).parent
URDF = HERE.parents[1] / "urdf"
ROVERS = {"nexus6": "nexus6", "cart": "cart", "triple": HERE / "rovers" / "triple.toml"}


class State(NamedTuple):
    q: np.ndarray
    v: np.ndarray
    torques: np.ndarray
    wheel_forces: np.ndarray


@pytest.fixture(scope="session", params=ROVERS)
def rover(request) -> Rover:
    """Every rover in turn, with rotors on its wheels."""
    loaded = load_rover(ROVERS[request.param])
    armature = np.zeros(loaded.model.nv)
    armature[[wheel.dof for wheel in loaded.wheels]] = 1e-3
    loaded.model.armature = armature
    return loaded


@pytest.fixture(scope="session")
def nexus6() -> Rover:
    return load_rover("nexus6")


@pytest.fixture(scope="session")
def random_state():
    """A function (rover, seed) -> State whose differential is held in angle and rate."""

    def make(rover: Rover, seed: int) -> State:
        rng = np.random.default_rng(seed)
        nv, n = rover.model.nv, len(rover.wheels)
        step, v = rng.uniform(-1.0, 1.0, nv), rng.normal(0.0, 2.0, nv)
        if rover.differential is not None:
            left, right, _, _ = rover.differential
            step[right], v[right] = -step[left], -v[left]
        q = pin.integrate(rover.model, pin.neutral(rover.model), step)
        return State(q, v, rng.normal(size=nv), rng.normal(0.0, 5.0, (n, 6)))

    return make


@pytest.fixture
def write_rover(tmp_path):
    """A function that puts a URDF beside Nexus 6's TOML, or another, and returns the TOML's path."""

    def write(text: str, layout: str | None = None) -> Path:
        (tmp_path / "nexus6.urdf").write_text(text)
        (tmp_path / "nexus6.toml").write_text(layout or (URDF / "nexus6.toml").read_text())
        return tmp_path / "nexus6.toml"

    return write
