"""What goes wrong says where."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from conftest import BALL

import palpate


def test_a_misspelt_key_is_named_with_its_line() -> None:
    text = BALL.replace("youngs_modulus = 2.0e4", "young_modulus = 2.0e4")
    with pytest.raises(palpate.SceneError, match='did you mean "youngs_modulus"') as caught:
        palpate.Scene.from_toml(text, name="ball.toml")
    e = caught.value
    assert (e.file, e.line, e.key) == ("ball.toml", 8, "material.young_modulus")
    assert isinstance(e, (palpate.PalpateError, ValueError))


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(palpate.SceneError, match="no such file") as caught:
        palpate.Scene.open(tmp_path / "nothing.toml")
    assert caught.value.file == str(tmp_path / "nothing.toml")


def test_a_broken_recording_is_no_broken_scene(root: Path, tmp_path: Path) -> None:
    shutil.copytree(root / "assets/recordings/torus-drop", tmp_path / "recordings/torus-drop")
    (tmp_path / "scenes").mkdir()
    shutil.copy(root / "assets/scenes/first-fit.toml", tmp_path / "scenes")
    file = tmp_path / "recordings/torus-drop/recording.toml"
    file.write_text(file.read_text().replace("fx", "fz", 1))
    with pytest.raises(palpate.RecordingError) as caught:
        palpate.Scene.open(tmp_path / "scenes/first-fit.toml")
    assert caught.value.file is not None
    assert caught.value.file.endswith("recording.toml")
    assert caught.value.key == "camera.0.fz"
    assert caught.value.line is not None
    file.unlink()
    with pytest.raises(palpate.PalpateError, match="no such file|there is no recording"):
        palpate.Scene.open(tmp_path / "scenes/first-fit.toml")


def test_a_simulation_that_fails_says_when_and_what_may_help(ball: palpate.Scene) -> None:
    # Nothing holds the ball: it has no equilibrium.
    text = BALL.replace("velocity = [0, 0, -1]", 'state = "static-equilibrium"').replace(
        "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n", ""
    )
    with pytest.raises(palpate.SimulationError) as caught:
        palpate.simulate(palpate.Scene.from_toml(text), backend="cpu")
    assert caught.value.hint
    assert caught.value.time == 0.0
    assert isinstance(caught.value, RuntimeError)


def test_wrong_arguments_say_what_is_allowed(ball: palpate.Scene) -> None:
    with pytest.raises(palpate.ArgumentError, match='"auto", "cpu", "gpu"') as caught:
        palpate.simulate(ball, backend="tpu")  # type: ignore[arg-type]
    assert caught.value.key == "backend"
    with pytest.raises(palpate.ArgumentError, match="seed: -1 must be a whole number"):
        palpate.fit(ball, seed=-1)
    with pytest.raises(palpate.ArgumentError, match="starts: 0 must be a whole number from 1"):
        palpate.fit(ball, starts=0)
    with pytest.raises(palpate.ArgumentError, match='allowed: "rprop"'):
        palpate.fit(ball, optimizer="adam")  # type: ignore[arg-type]
    with pytest.raises(palpate.ArgumentError, match="must be a palpate.Scene or a list"):
        palpate.fit("scene.toml")  # type: ignore[arg-type]
    with pytest.raises(palpate.SceneError, match="not a number of this scene") as scene:
        ball.with_values({"plane.7.height": 0.0})
    assert scene.value.key == "plane.7.height"
    with pytest.raises(palpate.SceneError, match="is missing or has no data to fit to"):
        palpate.fit(ball)
