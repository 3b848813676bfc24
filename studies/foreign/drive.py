"""The true motion of a cart with four wheels on hills: it slips, skids in turns, stops, and sometimes reverses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

R, HALF = 0.11, 0.26
"""Wheel radius of the simulated cart (R), and half of its track (HALF) [m]."""
CORNERS = ("fl", "fr", "bl", "br")


class Drive(NamedTuple):
    """Truth in SI: x forward, y left, z up; yaw to the left, pitch nose down, roll right side down; rates forward."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    yaw: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    turn: np.ndarray
    rates: np.ndarray
    """Wheel rates (4, n) [rad/s] in the order of CORNERS."""
    currents: np.ndarray
    """Motor currents (4, n) [A]."""
    duties: np.ndarray
    """Motor duties (4, n)."""


def drive(random: np.random.Generator) -> Drive:
    """Return a random drive of one to two minutes."""
    rate = float(random.choice([5.0, 10.0, 20.0, 25.0]))
    t = np.arange(0.0, float(random.uniform(70.0, 130.0)), 1.0 / rate)
    speed = _speed(t, random)
    moving = np.abs(speed) > 1e-4
    turn = _waves(t, random, 0.02, 0.15) * float(random.uniform(0.05, 0.15)) * moving
    yaw = float(random.uniform(-3.0, 3.0)) + np.cumsum(turn) / rate
    way = {"x": np.cumsum(speed * np.cos(yaw)) / rate, "y": np.cumsum(speed * np.sin(yaw)) / rate}
    z, ahead, left = _hills(way["x"], way["y"], yaw, random)
    pitch, roll = -np.arctan(ahead), np.arctan(left * np.cos(np.arctan(ahead)))
    # Slip grows with the climb; the rims turn by 1 / (1 - S) faster than the wheels travel.
    climb = -pitch * np.sign(speed)
    slip = np.clip(0.06 + 0.8 * climb + 0.03 * _waves(t, random, 0.1, 0.5), -0.2, 0.6)
    rim = speed / (1.0 - slip)
    # Without steering, the rims turn further apart than the yaw rate alone requires.
    skid = float(random.uniform(1.0, 1.8))
    sides = np.array([-1.0, 1.0, -1.0, 1.0])[:, None]
    wheel_factor = np.array([1.0 + 0.05 * _waves(t, random, 0.1, 0.6) for _ in CORNERS])
    rates = (rim * wheel_factor + sides * HALF * skid * turn) / R * moving
    # Current grows with climb and turn; the duty overcomes back-EMF and resistance.
    load = 0.4 + 2.5 * climb + 2.0 * np.abs(turn) + 0.15 * np.array([_waves(t, random, 0.2, 1.0) for _ in CORNERS])
    currents = np.maximum(0.05, load) * np.sign(rates) * moving + 0.01 * random.standard_normal((4, len(t)))
    duties = np.clip((0.22 * rates + 0.3 * currents) / 3.0, -1.0, 1.0)
    noise = random.normal(0.0, 1.0, (6, len(t)))
    return Drive(
        t,
        way["x"] + 2e-3 * noise[0],
        way["y"] + 2e-3 * noise[1],
        z + 2e-3 * noise[2],
        yaw + 3e-3 * noise[3],
        pitch + 2e-3 * noise[4],
        roll + 2e-3 * noise[5],
        turn + 2e-3 * random.standard_normal(len(t)),
        rates + 3e-3 * random.standard_normal((4, len(t))),
        currents,
        duties,
    )


def _speed(t: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the speed over ground [m/s], with one or two stops, and in one drive of three a section in reverse."""
    speed = float(random.uniform(0.06, 0.35)) * (1.0 + 0.35 * _waves(t, random, 0.02, 0.2))
    # One or two stops of 5 s.
    for at in random.uniform(0.2, 0.8, random.integers(1, 3)) * t[-1]:
        speed = speed * ~((t > at) & (t < at + 5.0))
    # In one drive of three, a section in reverse.
    if random.random() < 1.0 / 3.0:
        begin = float(random.uniform(0.3, 0.6)) * t[-1]
        speed = np.where((t > begin) & (t < begin + 0.3 * t[-1]), -speed, speed)
    return speed * (t > 2.0)


def _waves(t: np.ndarray, random: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Return a smooth signal of size 1 with frequencies from `low` to `high` [Hz]."""
    terms = [
        np.sin(2.0 * np.pi * float(random.uniform(low, high)) * t + float(random.uniform(0.0, 6.0))) for _ in range(4)
    ]
    return np.sum(terms, axis=0) / 2.0


def _hills(
    x: np.ndarray, y: np.ndarray, yaw: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return height, slope along the heading and slope to the left, on a few waves of ground."""
    z, gx, gy = (np.zeros(len(x)) for _ in range(3))
    for _ in range(4):
        length, angle, phase = random.uniform(4.0, 14.0), random.uniform(0.0, 6.28), random.uniform(0.0, 6.28)
        # Height grows with wavelength, so that all waves have similar slopes.
        k, size = 2.0 * np.pi / length, 0.008 * length
        u, v = k * np.cos(angle), k * np.sin(angle)
        z += size * np.sin(u * x + v * y + phase)
        gx += size * u * np.cos(u * x + v * y + phase)
        gy += size * v * np.cos(u * x + v * y + phase)
    # Slopes along the heading and to its left, from the gradient in x and y.
    return z, np.cos(yaw) * gx + np.sin(yaw) * gy, np.cos(yaw) * gy - np.sin(yaw) * gx
