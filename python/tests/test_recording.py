"""Recordings of arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import palpate


def test_what_is_wrong_with_arrays_is_said_with_its_key(motion: palpate.Simulation) -> None:
    times, rest = np.array([0.0, 0.1]), np.zeros((2, 3))
    points = np.zeros((2, 2, 3))

    def refused(match: str, **given: Any) -> palpate.PalpateError:
        with pytest.raises(palpate.PalpateError, match=match) as caught:
            palpate.Recording.from_arrays(**{"times": times, "points": points, "rest": rest, **given})
        return caught.value

    assert refused("not after the one before", times=[0.1, 0.1]).key == "points.times"
    assert isinstance(refused("all is NaN", points=np.full((2, 2, 3), np.nan)), palpate.RecordingError)
    assert refused(r"points: has shape \(2, 2\), expected \(2, any, 3\)", points=np.zeros((2, 2))).key == "points"
    assert refused(r"points: has shape \(3, 2, 3\), expected \(2, any, 3\)", points=np.zeros((3, 2, 3))).key == "points"
    assert refused(r"rest: has shape \(5, 3\), expected \(2, 3\)", rest=np.zeros((5, 3))).key == "rest"
    assert refused("is missing: where every point lies", rest=None).key == "rest"
    assert refused("must lie in", noise_sigma=0.0).key == "points.noise_sigma"
    assert refused("is no array of real numbers", points="many").key == "points"
    assert refused("its dtype is complex128", points=points.astype(complex)).key == "points"
    assert refused("its dtype is object", times=None).key == "times"
    assert refused("all is NaN", points=np.ma.masked_array(points, mask=True)).key == "points"
    with pytest.raises(palpate.ArgumentError, match="nothing was measured"):
        palpate.Recording.from_arrays(times=times)


def test_points_elsewhere_are_refused_by_the_scene(ball: palpate.Scene) -> None:
    far = palpate.Recording.from_arrays(times=[0.0, 0.05], points=np.full((2, 1, 3), 9.0), rest=[[0, 0, 0.01]])
    with pytest.raises(palpate.SceneError) as caught:
        ball.with_recording(far)
    assert caught.value.key == "observation.recording"


def test_recordings_are_folders_too(seen: palpate.Scene, recording: palpate.Recording, tmp_path: Path) -> None:
    recording.save(tmp_path / "points")
    again = palpate.Recording.open(tmp_path / "points")
    assert again.kinds == ["points"]
    given = palpate.simulate(seen, backend="cpu").residuals
    read = palpate.simulate(seen.with_recording(again), backend="cpu").residuals
    assert given is not None
    assert read is not None
    assert np.array_equal(read.distance, given.distance)


def test_markers_and_displacements_are_compared(ball: palpate.Scene, motion: palpate.Simulation) -> None:
    at, picked = slice(2, None, 4), [0, 5, 40]
    markers = palpate.Recording.from_arrays(
        times=motion.times[at],
        markers=motion.surface[at][:, picked] + [1e-3, 0, 0],
        marker_rest=ball.surface[picked],
        marker_names=["a", "b", "c"],
        displacements=motion.displacement[at],
        nodes=ball.nodes,
        noise_sigma=1e-3,
    )
    assert sorted(markers.kinds) == ["displacements", "markers"]
    only = palpate.simulate(ball.with_recording(markers, cost="markers"), backend="cpu").residuals
    assert only is not None
    assert only.sensors == ["a", "b", "c"]
    # All are off by a millimetre.
    assert np.allclose(only.distance, 1e-3, rtol=1e-6)
    both = palpate.simulate(ball.with_recording(markers), backend="cpu").residuals
    assert both is not None
    nodes = both.sensor == both.sensors.index("nodes")
    assert nodes.sum() == len(ball.nodes) * len(motion.times[at])
    # The same simulation: the same bits.
    assert np.max(both.distance[nodes]) < 1e-12


def depth_of_a_plane() -> "tuple[np.ndarray[Any, Any], palpate.Camera]":
    """A camera half a metre above the ball that sees the floor, and a flat piece at the height of the ball's top."""
    depth = np.full((2, 48, 64), np.nan)
    depth[:, 20:28, 28:36] = 0.39
    pose = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.5], [0, 0, 0, 1]])
    k = np.array([[300.0, 0, 31.5], [0, 300, 23.5], [0, 0, 1]])
    return depth, {"K": k, "world_from_camera": pose, "noise_sigma": 0.001, "name": "top"}


def test_depth_is_metres_or_counts(ball: palpate.Scene) -> None:
    depth, camera = depth_of_a_plane()
    metres = palpate.Recording.from_arrays(times=[0.0, 0.01], depth=depth, camera=camera)
    counts = np.nan_to_num(depth * 1000).astype(np.uint16)
    scaled: palpate.Camera = {**camera, "depth_scale": 0.001}
    counted = palpate.Recording.from_arrays(times=[0.0, 0.01], depth=counts, camera=scaled)
    for r in (metres, counted):
        residuals = palpate.simulate(ball.with_recording(r), backend="cpu").residuals
        assert residuals is not None
        assert residuals.sensors == ["top"]
        assert len(residuals) == 2 * 8 * 8
        # Counts round: those of metres by a 65535th of the farthest, those of millimetres by half of one.
        assert np.allclose(residuals.measured[:, 2], 0.11, atol=0.5e-3)
    with pytest.raises(palpate.ArgumentError, match="metres per count"):
        palpate.Recording.from_arrays(times=[0.0, 0.01], depth=counts, camera=camera)
    with pytest.raises(palpate.ArgumentError, match="unknown key; allowed: name, K"):
        palpate.Recording.from_arrays(times=[0.0, 0.01], depth=depth, camera={**camera, "pose": 1})  # type: ignore[arg-type]
    with pytest.raises(palpate.RecordingError, match="not rigid"):
        palpate.Recording.from_arrays(times=[0.0, 0.01], depth=depth, camera={**camera, "world_from_camera": 2 * np.eye(4)})


def test_masks_leave_out_what_is_something_else(ball: palpate.Scene) -> None:
    depth, camera = depth_of_a_plane()
    masks = np.zeros(depth.shape, dtype=bool)
    masks[:, 20:24, 28:36] = True
    scene = ball.with_recording(
        palpate.Recording.from_arrays(times=[0.0, 0.01], depth=depth, camera={**camera, "masks": masks})
    )
    residuals = palpate.simulate(scene, backend="cpu").residuals
    assert residuals is not None
    assert len(residuals) == 2 * 4 * 8


def test_a_second_camera_joins(ball: palpate.Scene) -> None:
    depth, camera = depth_of_a_plane()
    one = palpate.Recording.from_arrays(times=[0.0, 0.01], depth=depth, camera=camera)
    two = one.with_camera([0.005], depth[:1], {**camera, "name": "other"})
    residuals = palpate.simulate(ball.with_recording(two), backend="cpu").residuals
    assert residuals is not None
    assert residuals.sensors == ["top", "other"]
    assert len(residuals) == 3 * 64
    with pytest.raises(palpate.RecordingError, match='two cameras are named "top"'):
        one.with_camera([0.005], depth[:1], camera)
