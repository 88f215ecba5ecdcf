"""Scenes: what they say as arrays, and with other values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import BALL

import palpate


def test_a_scene_says_what_it_holds(ball: palpate.Scene) -> None:
    assert ball.title == "A ball"
    assert ball.text == BALL
    assert ball.nodes.dtype == np.float64
    assert ball.nodes.ndim == 2
    assert ball.nodes.shape[1] == 3
    radii = np.linalg.norm(ball.surface - [0, 0, 0.06], axis=1)
    # The surface is that of the ball; its vertices are found by bisection of a distance that is exact.
    assert np.allclose(radii, 0.05, atol=1e-6)
    assert ball.triangles.max() + 1 == len(ball.surface)
    assert ball.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.02)
    assert ball.mass == pytest.approx(1000 * ball.volume)
    assert ball.recording is None
    assert len(ball.frame_times) == 0
    assert "nodes" in repr(ball)


def test_parameters_have_names_units_and_ranges(ball: palpate.Scene) -> None:
    numbers = {p.name: p for p in ball.parameters}
    stiffness = numbers["material.youngs_modulus"]
    assert (stiffness.value, stiffness.unit, stiffness.free) == (2.0e4, "Pa", True)
    assert stiffness.bounds == (1e3, 1e6)
    assert stiffness.start == (4e4, 4e4)
    gravity = numbers["world.gravity.z"]
    assert (gravity.value, gravity.unit, gravity.free, gravity.start) == (-9.81, "m/s²", False, None)
    low, high = numbers["material.poisson_ratio"].limits
    assert low < 0.4 < high


def test_values_can_be_changed_by_their_path(ball: palpate.Scene) -> None:
    changed = ball.with_values({"material.youngs_modulus": 3e4, "plane.0.height": -0.01, "world.gravity.x": 1.0})
    numbers = {p.name: p.value for p in changed.parameters}
    assert numbers["material.youngs_modulus"] == 3e4
    assert numbers["plane.0.height"] == -0.01
    assert numbers["world.gravity.x"] == 1.0
    # The first is what it was, and starts of a fit are nobody's business.
    assert {p.name: p.value for p in ball.parameters}["material.youngs_modulus"] == 2e4
    assert "start = 4.0e4" in changed.text


def test_a_scene_that_is_written_is_the_same(ball: palpate.Scene, tmp_path: Path) -> None:
    ball.save(tmp_path / "ball.toml")
    again = palpate.Scene.open(tmp_path / "ball.toml")
    assert np.array_equal(again.nodes, ball.nodes)
    assert [p.value for p in again.parameters] == [p.value for p in ball.parameters]


def test_a_scene_may_be_opened_without_its_recording(root: Path) -> None:
    file = root / "assets/scenes/first-fit.toml"
    assert palpate.Scene.open(file, recording=False).recording is None
    opened = palpate.Scene.open(file)
    assert opened.recording is not None
    assert opened.recording.kinds == ["sparse-surface"]
    assert np.all(np.diff(opened.frame_times) > 0)


def test_displacements_carry_the_surface(ball: palpate.Scene) -> None:
    shift = np.array([0.01, -0.02, 0.03])
    moved = ball.deform(np.tile(shift, (len(ball.nodes), 1)))
    assert np.allclose(moved, ball.surface + shift, atol=1e-12)
    with pytest.raises(palpate.ArgumentError, match=r"displacement: has shape \(2, 3\)"):
        ball.deform(np.zeros((2, 3)))
