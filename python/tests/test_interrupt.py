"""Ctrl-C, exceptions in listeners, and threads."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import BALL

import palpate

# Long enough that nobody waits for its end.
LONG = BALL.replace("steps = 16", "steps = 200000").replace("cell_size = 0.025", "cell_size = 0.0125")


def press_after(seconds: float) -> None:
    threading.Timer(seconds, lambda: signal.raise_signal(signal.SIGINT)).start()


def test_ctrl_c_ends_a_simulation() -> None:
    scene = palpate.Scene.from_toml(LONG)
    begun = time.monotonic()
    press_after(0.5)
    with pytest.raises(KeyboardInterrupt):
        palpate.simulate(scene, backend="cpu")
    # At the next step, which takes some 50 ms; a minute of other work beside it is allowed for.
    assert time.monotonic() - begun < 60


def test_ctrl_c_ends_a_fit_with_the_best_so_far(seen: palpate.Scene) -> None:
    def listener(p: palpate.Progress) -> None:
        if p.iteration == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(palpate.Interrupted) as caught:
        palpate.fit(seen, backend="cpu", grid_check=False, progress=listener)
    assert isinstance(caught.value, KeyboardInterrupt)
    best = caught.value.result
    assert best is not None
    # The signal may come while the last evaluations end.
    assert best.verdict in ("interrupted", "converged")
    assert len(best.history["run"]) >= 3
    assert np.isfinite(best.values["material.youngs_modulus"])


def test_a_problem_can_be_used_after_ctrl_c(seen: palpate.Scene) -> None:
    long = palpate.Scene.from_toml(LONG).with_recording(seen.recording)  # type: ignore[arg-type]
    problem = palpate.Problem(seen, backend="cpu")
    before = problem([3e4])
    slow = palpate.Problem(long, backend="cpu")
    press_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        slow([3e4])
    assert problem([3e4]) == before


def test_what_a_listener_raises_ends_the_work(ball: palpate.Scene) -> None:
    class Enough(Exception):
        pass

    heard = []

    def listener(p: palpate.Progress) -> None:
        heard.append(p)
        if p.done == 3:
            raise Enough

    with pytest.raises(Enough):
        palpate.simulate(ball, backend="cpu", progress=listener)
    assert len(heard) == 4


def test_python_goes_on_beside_a_simulation(ball: palpate.Scene) -> None:
    """The interpreter is free: another thread counts, and a second simulation gives the same bits."""
    results, counted = [], 0
    threads = [threading.Thread(target=lambda: results.append(palpate.simulate(ball, backend="cpu"))) for _ in range(2)]
    for t in threads:
        t.start()
    while any(t.is_alive() for t in threads):
        counted += 1
        time.sleep(0.001)
    assert counted > 5
    assert np.array_equal(results[0].displacement, results[1].displacement)


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="there is no fork on this system")
def test_a_forked_process_is_told_what_to_do(tmp_path: Path) -> None:
    script = tmp_path / "fork.py"
    script.write_text(
        f"""
import os, palpate
scene = palpate.Scene.from_toml({BALL!r})
palpate.simulate(scene, backend="cpu")
pid = os.fork()
if pid == 0:
    try:
        palpate.simulate(scene, backend="cpu")
    except palpate.ArgumentError as e:
        os._exit(7 if "spawn" in str(e) else 1)
    os._exit(2)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""
    )
    assert subprocess.run([sys.executable, str(script)], timeout=120).returncode == 7
