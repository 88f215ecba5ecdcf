"""Tracking and diagnoses."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

import palpate

BAR = """\
format = "scene/1"
[object]
shape = { box = { min = [0, -0.02, -0.02], max = [0.16, 0.02, 0.02] } }
cell_size = 0.02
[material]
density = 1000.0
youngs_modulus = 5.0e4
poisson_ratio = 0.4
stiffness_damping = 0.002
[[clamp]]
box = { min = [-0.01, -0.1, -0.1], max = [0.0001, 0.1, 0.1] }
[time]
step = 0.005
duration = 0.3
[fit]
[[fit.parameter]]
path = "material.youngs_modulus"
"""


def test_a_body_is_tracked_through_its_recording(ball: palpate.Scene, motion: palpate.Simulation) -> None:
    at = slice(0, None, 4)
    recording = palpate.Recording.from_arrays(
        times=motion.times[at], points=motion.surface[at], rest=ball.surface, noise_sigma=1e-4
    )
    heard: list[palpate.Progress] = []
    track = palpate.track(ball.with_recording(recording), progress=heard.append)
    f, n, v = 5, len(ball.nodes), len(ball.surface)
    assert [p.done for p in heard] == [1, 2, 3, 4, 5]
    assert len(track) == f
    assert track.displacement.shape == track.velocity.shape == (f, n, 3)
    assert track.surface.shape == (f, v, 3)
    assert track.sigma.shape == track.seen.shape == (f, v)
    assert track.data.shape == (f, n)
    assert track.seen.dtype == np.bool_
    assert track.result["format"] == "tracking/1"
    # All of the surface was measured to a tenth of a millimetre.
    assert np.sqrt(np.mean((track.surface - motion.surface[at]) ** 2)) < 3e-4


def test_what_cameras_saw_becomes_a_recording(binary: str, tmp_path: Path) -> None:
    """A bar that is let go and swings: tracked with twice its stiffness, and fitted to what was tracked."""
    (tmp_path / "bar.toml").write_text(BAR)
    cameras = ["eye=0.1,-0.5,0.15 target=0.08,0,-0.02 fov=30 size=64x48", "eye=0.4,0.3,0.2 target=0.08,0,-0.02 fov=30 size=64x48"]
    options = ["--fps", "30", "--noise", "0.001", "--depth-scale", "0.0001", "--camera", cameras[0], "--camera", cameras[1]]
    subprocess.run([binary, "observe", "bar.toml", *options, "--out", "seen"], cwd=tmp_path, check=True, capture_output=True)
    bar = palpate.Scene.from_toml(BAR).with_values({"material.youngs_modulus": 1e5})
    track = palpate.track(bar.with_recording(palpate.Recording.open(tmp_path / "seen")))
    seen = track.seen
    assert 0.2 < seen.mean() < 0.9
    # What is hidden is known less well.
    assert np.median(track.sigma[seen]) < np.median(track.sigma[~seen])
    points = track.recording()
    assert points.kinds == ["points"]
    found = palpate.fit(bar.with_recording(points), backend="cpu", grid_check=False)
    # The truth, by points that were themselves found with the wrong stiffness.
    assert found.values["material.youngs_modulus"] == pytest.approx(5e4, rel=0.2)


def test_a_missing_law_is_found(ball: palpate.Scene, motion: palpate.Simulation) -> None:
    """Recorded with a side wind that the scene does not know."""
    blown = palpate.Scene.from_toml(ball.text + '[[effect]]\nkind = "uniform-force"\nforce = [3000.0, 0, 0]\n')
    moved = palpate.simulate(blown, backend="cpu")
    picked = np.linspace(0, len(ball.surface) - 1, 30).astype(int)
    points = moved.surface[1:][:, picked] + 1e-4 * np.random.default_rng(2).standard_normal((16, 30, 3))
    recording = palpate.Recording.from_arrays(times=moved.times[1:], points=points, rest=ball.surface[picked], noise_sigma=1e-4)
    said: list[str] = []
    d = palpate.diagnose(ball.with_recording(recording), backend="cpu", progress=lambda p: said.append(p.message))
    assert said
    assert d.result["format"] == "diagnosis/2"
    assert len(d.found) >= 1
    assert d.scene is not None
    assert d.found[0] in d.scene.text
    before = palpate.simulate(ball.with_recording(recording), backend="cpu").residuals
    after = palpate.simulate(d.scene, backend="cpu").residuals
    assert before is not None
    assert after is not None
    assert after.rms < 0.2 * before.rms


def test_nothing_to_track_is_said(ball: palpate.Scene) -> None:
    with pytest.raises(palpate.SceneError, match="names no recording"):
        palpate.track(ball)
