"""Fits: the numbers, their bits, and what is left behind."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest


import palpate


@pytest.fixture(scope="module")
def found(seen: palpate.Scene) -> palpate.Fit:
    return palpate.fit(seen, backend="cpu")


def timeless(result: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in result.items() if key != "seconds"}


def test_what_was_hidden_is_found(found: palpate.Fit) -> None:
    assert found.verdict == "converged"
    assert found.reasons == []
    error = found.errors["material.youngs_modulus"]
    assert error is not None
    # Made and fitted on the same cells: what is off is noise, which ± holds beside what cells may do.
    uncorrected = found.result["parameters"][0].get("uncorrected", found.values["material.youngs_modulus"])
    noise = found.result["parameters"][0]["parts"]["noise"]
    assert abs(uncorrected - 2e4) < 4 * noise
    assert found.result["format"] == "fit/2"


def test_history_and_residuals_are_arrays(found: palpate.Fit) -> None:
    h = found.history
    assert h["values"].shape == (len(h["run"]), 1)
    assert h["values"][0, 0] == 4e4
    assert h["cost"][-1] < 1e-2 * h["cost"][0]
    assert np.array_equal(h["iteration"], np.arange(len(h["iteration"])))
    (r,) = found.residuals()
    assert len(r) == found.result["residual"]["points"]
    assert r.rms == pytest.approx(found.result["residual"]["rms"], rel=1e-12)


def test_what_was_found_is_a_scene_again(found: palpate.Fit) -> None:
    number = found.result["parameters"][0]
    value = {p.name: p.value for p in found.scene.parameters}["material.youngs_modulus"]
    assert value == number.get("uncorrected", number["value"])
    again = palpate.simulate(found.scene, backend="cpu").residuals
    assert again is not None
    assert np.array_equal(again.distance, found.residuals()[0].distance)


def test_results_have_the_bits_of_the_command_line(root: Path, binary: str, tmp_path: Path) -> None:
    scene = root / "assets/scenes/first-fit.toml"
    # Two searches, cut short: the check of cells is compared on a smaller body below.
    options = ["--backend", "cpu", "--starts", "2", "--iterations", "2", "--no-grid-check", "--pictures", "0"]
    subprocess.run([binary, "fit", str(scene), *options, "--out", str(tmp_path / "cli")], check=True, capture_output=True)
    written = json.loads((tmp_path / "cli/result.json").read_text())
    fit = palpate.fit(palpate.Scene.open(scene), backend="cpu", starts=2, iterations=2, grid_check=False)
    assert timeless(fit.result) == timeless(written)
    fit.save(tmp_path / "python", pictures=0)
    for name in ("history.csv", "model.toml"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes()
    assert timeless(json.loads((tmp_path / "python/result.json").read_text())) == timeless(written)
    assert (tmp_path / "python/report.html").stat().st_size > 1000


def test_arrays_have_the_bits_of_files(seen: palpate.Scene, found: palpate.Fit, binary: str, tmp_path: Path) -> None:
    assert seen.recording is not None
    seen.recording.save(tmp_path / "recording")
    text = seen.text.replace("[fit]", '[observation]\nrecording = "recording"\ncost = "points"\n[fit]')
    (tmp_path / "ball.toml").write_text(text)
    command = [binary, "fit", "ball.toml", "--backend", "cpu", "--out", "out", "--pictures", "0"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    written = json.loads((tmp_path / "out/result.json").read_text())
    own = timeless(found.result)
    assert own["parameters"] == written["parameters"]
    assert own["cost"] == written["cost"]
    assert own["residual"] == written["residual"]
    assert own["runs"] == written["runs"]


def test_several_scenes_are_fitted_together(seen: palpate.Scene, found: palpate.Fit) -> None:
    both = palpate.fit([seen, seen.with_values({"world.gravity.z": -9.8})], backend="cpu", grid_check=False)
    assert list(both.values) == ["material.youngs_modulus"]
    assert len(both.scenes) == 2
    assert len(both.residuals()) == 2
    # Twice the readings: the noise is counted for less.
    assert both.result["parameters"][0]["parts"]["noise"] < found.result["parameters"][0]["parts"]["noise"]


def test_a_fit_goes_on_with_its_journal(seen: palpate.Scene, tmp_path: Path) -> None:
    journal = tmp_path / "journal.jsonl"
    short = palpate.fit(seen, backend="cpu", iterations=2, grid_check=False, journal=journal)
    resumed = palpate.fit(seen, backend="cpu", iterations=2, grid_check=False, journal=journal, resume=True)
    assert timeless(resumed.result) == timeless(short.result)
    with pytest.raises(palpate.ArgumentError, match="needs the journal"):
        palpate.fit(seen, resume=True)


def test_iterations_are_heard(seen: palpate.Scene) -> None:
    heard: list[palpate.Progress] = []
    fit = palpate.fit(seen, backend="cpu", iterations=3, grid_check=False, progress=heard.append)
    iterations = [p for p in heard if p.iteration is not None]
    assert [p.cost for p in iterations] == list(fit.history["cost"])
    assert [p.values for p in iterations] == fit.history["values"].tolist()


def test_the_wheel_has_the_command_line(tmp_path: Path, root: Path) -> None:
    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-m", "palpate", *arguments]
        return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)

    version = run("--version")
    assert version.stdout.strip() == f"palpate {palpate.__version__}"
    wrong = run("fit", str(root / "nothing.toml"))
    assert wrong.returncode == 2
    assert "no such file" in wrong.stderr
