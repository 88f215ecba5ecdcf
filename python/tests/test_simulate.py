"""Simulations as arrays."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import BALL, NOISE

import palpate


def test_arrays_have_the_shapes_that_they_promise(ball: palpate.Scene, motion: palpate.Simulation) -> None:
    f, n, v = 17, len(ball.nodes), len(ball.surface)
    assert len(motion) == f
    assert motion.times.shape == (f,)
    assert motion.displacement.shape == (f, n, 3)
    assert motion.velocity.shape == (f, n, 3)
    assert motion.surface.shape == (f, v, 3)
    assert np.array_equal(motion.nodes, ball.nodes)
    assert np.array_equal(motion.triangles, ball.triangles)
    assert np.array_equal(motion.surface[0], ball.surface)
    assert np.array_equal(motion.surface[9], ball.deform(motion.displacement[9]))
    assert np.all(motion.displacement[0] == 0)
    # It begins as the scene says: at rest in itself, with one metre a second down.
    assert np.allclose(motion.velocity[0], [0, 0, -1])
    assert motion.residuals is None


def test_a_ball_falls_freely_until_it_lands(motion: palpate.Simulation) -> None:
    t = motion.times[2]
    drop = -motion.displacement[2, :, 2].mean()
    # It lands after a hundredth of a second and a step. The scheme is of second order or better over two steps of 5 ms.
    assert drop == pytest.approx(t + 0.5 * 9.81 * t * t, rel=5e-3)


def test_states_have_the_bits_of_the_command_line(
    ball: palpate.Scene, motion: palpate.Simulation, binary: str, tmp_path: Path
) -> None:
    (tmp_path / "ball.toml").write_text(BALL)
    command = [binary, "simulate", "ball.toml", "--backend", "cpu", "--format", "ply", "--every", "16", "--out", "out"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    head, body = (tmp_path / "out/frame_00016.ply").read_bytes().split(b"end_header\n", 1)
    count = int(head.split(b"element vertex ")[1].split(b"\n")[0])
    kind = "<f8" if b"property double x" in head else "<f4"
    written = np.frombuffer(body, dtype=kind, count=3 * count).reshape(count, 3)
    assert np.array_equal(written, motion.surface[16].astype(kind))


def test_residuals_are_those_of_the_noise(seen: palpate.Scene, recording: palpate.Recording) -> None:
    simulated = palpate.simulate(seen, backend="cpu")
    r = simulated.residuals
    assert r is not None
    # Twenty points in eight frames, of which one was not seen.
    assert len(r) == 8 * 20 - 1
    assert r.sensors == ["points"]
    assert np.all(np.diff(r.frame.astype(int)) >= 0)
    assert np.allclose(np.linalg.norm(r.simulated - r.measured, axis=1), r.distance, atol=1e-15)
    # Three coordinates of the noise; the mean square of some 500 of them is known to 6 %.
    assert r.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.2)
    assert np.array_equal(np.unique(r.time), seen.frame_times)


def test_progress_is_heard_state_by_state(ball: palpate.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    heard: list[palpate.Progress] = []
    palpate.simulate(ball, backend="cpu", progress=heard.append)
    assert [p.done for p in heard] == list(range(17))
    assert {(p.what, p.total) for p in heard} == {("simulate", 16)}
    palpate.simulate(ball, backend="cpu", progress=True)
    assert capfd.readouterr().err.endswith("palpate simulate: 16 of 16\n")
