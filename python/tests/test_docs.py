"""What the documentation shows runs: docs/python.md, and the notebook."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import palpate


def test_the_page_about_python_runs(root: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    page = (root / "docs/python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 9
    names: dict[str, Any] = {}
    for number, block in enumerate(blocks):
        exec(compile(block, f"docs/python.md, example {number + 1}", "exec"), names)
    printed = capsys.readouterr().out
    for said in ("(17,)", "<palpate.Fit converged", "(128,)", "ball.toml 8 material.young_modulus"):
        assert said in printed, printed
    # Found by the fit, and by SciPy.
    assert abs(names["found"].values["material.youngs_modulus"] - 2e4) < 4 * names["found"].errors["material.youngs_modulus"]
    assert abs(names["problem"].values(names["best"].x)[0] - 2e4) < 200


def test_the_notebook_runs(root: Path) -> None:
    folder = root / "python/notebooks"
    notebook = nbformat.read(folder / "first_fit.ipynb", as_version=4)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    texts = [o.get("text", "") for c in notebook.cells if c.cell_type == "code" for o in c.outputs]
    found = re.search(r"Young's modulus: (\d+) ± (\d+) Pa", "".join(texts))
    assert found, texts
    value, error = map(float, found.groups())
    # The truth behind the recording.
    assert abs(value - 5e4) < 3 * error
    pictures = [o for c in notebook.cells if c.cell_type == "code" for o in c.outputs if "image/png" in o.get("data", {})]
    assert len(pictures) == 3


def test_motion_is_logged_to_rerun(seen: palpate.Scene, tmp_path: Path) -> None:
    rr = pytest.importorskip("rerun", reason="rerun-sdk is not installed: 170 MB, and an option")
    from palpate.rerun_log import log

    stream = rr.RecordingStream("palpate-test")
    stream.save(str(tmp_path / "ball.rrd"))
    motion = palpate.simulate(seen, backend="cpu")
    assert log(motion, "ball", recording=stream) == len(motion)
    stream.flush()
    stream.disconnect()
    data = (tmp_path / "ball.rrd").read_bytes()
    # Seventeen surfaces, and the names of what is logged.
    assert len(data) > 17 * motion.surface[0].astype(np.float32).nbytes / 10
    for entity in (b"ball/surface", b"ball/readings/points", b"ball/rms"):
        assert entity in data
