"""A soft ball that falls on a floor, and where things are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import palpate

ROOT = Path(__file__).resolve().parents[2]

BALL = """\
format = "scene/1"
title = "A ball"
[object]
shape = { ball = { radius = 0.05, center = [0, 0, 0.06] } }
cell_size = 0.025
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
[[plane]]
point = [0, 0, 0]
normal = [0, 0, 1]
[initial]
velocity = [0, 0, -1]
[time]
step = 0.005
steps = 16
[fit]
starts = 1
iterations = 20
[[fit.parameter]]
path = "material.youngs_modulus"
start = 4.0e4
bounds = [1e3, 1e6]
"""

NOISE = 1e-4


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def binary() -> str:
    """The command line that results are compared with: that of cargo, not that of the wheel."""
    path = os.environ.get("PALPATE_BINARY", str(ROOT / "target/release/palpate"))
    assert Path(path).exists(), f"{path} is not there; cargo build --release --bin palpate, or set PALPATE_BINARY"
    return path


@pytest.fixture(scope="session")
def ball() -> palpate.Scene:
    """Without a recording."""
    return palpate.Scene.from_toml(BALL)


@pytest.fixture(scope="session")
def motion(ball: palpate.Scene) -> palpate.Simulation:
    return palpate.simulate(ball, backend="cpu")


@pytest.fixture(scope="session")
def recording(motion: palpate.Simulation) -> palpate.Recording:
    """Twenty points of the surface, with noise, one of them not seen at first."""
    picked = np.linspace(0, motion.surface.shape[1] - 1, 20).astype(int)
    points = motion.surface[2::2][:, picked]
    points = points + NOISE * np.random.default_rng(1).standard_normal(points.shape)
    points[0, 3] = np.nan
    return palpate.Recording.from_arrays(
        times=motion.times[2::2], points=points, rest=motion.scene.surface[picked], noise_sigma=NOISE
    )


@pytest.fixture(scope="session")
def seen(ball: palpate.Scene, recording: palpate.Recording) -> palpate.Scene:
    """The ball with the recording of its points."""
    return ball.with_recording(recording)
