"""The four verbs, with ``progress=True`` as a line on stderr."""

from __future__ import annotations

import sys
import time
from typing import Any, Callable, Optional, Union

from . import _palpate

Listener = Callable[[Any], None]

#: Least time between two lines [s]; the last message of a run appears in any case.
PAUSE = 0.2


class _Line:
    """Shows the newest message on one line of stderr."""

    def __init__(self) -> None:
        self.shown = 0.0
        self.last = ""
        self.width = 0

    def __call__(self, event: Any) -> None:
        self.last = f"palpate {event.what}: {event.message}"
        now = time.monotonic()
        if now - self.shown >= PAUSE:
            self.shown = now
            self.write()

    def write(self) -> None:
        text = self.last
        sys.stderr.write("\r" + text.ljust(self.width))
        sys.stderr.flush()
        self.width = len(text)

    def end(self) -> None:
        if self.last:
            self.write()
            sys.stderr.write("\n")
            sys.stderr.flush()


def _heard(verb: Callable[..., Any], progress: Union[bool, Listener, None], *args: Any, **options: Any) -> Any:
    if progress is True:
        line = _Line()
        try:
            return verb(*args, progress=line, **options)
        finally:
            line.end()
    return verb(*args, progress=progress or None, **options)


def simulate(scene: Any, *, backend: str = "auto", progress: Union[bool, Listener, None] = None) -> Any:
    """Simulates a scene with its own values and keeps every state.

    ``progress`` is called with a Progress for every state, or True for a line on stderr. Ctrl-C raises KeyboardInterrupt.
    """
    return _heard(_palpate.simulate, progress, scene, backend=backend)


def fit(
    scene: Any,
    *,
    backend: str = "auto",
    optimizer: Optional[str] = None,
    iterations: Optional[int] = None,
    starts: Optional[int] = None,
    seed: Optional[int] = None,
    threads: Optional[int] = None,
    batch: Optional[int] = None,
    grid_check: bool = True,
    journal: Any = None,
    resume: bool = False,
    progress: Union[bool, Listener, None] = None,
) -> Any:
    """Finds the free parameters of a scene, or of a list of scenes that are fitted together.

    What is None is taken from the (first) scene's [fit] table. The result has the bits of ``palpate fit``. Evaluations are kept in the file
    ``journal``, and with ``resume`` a fit goes on with what it holds. Ctrl-C raises Interrupted, whose ``result`` is the best so far.
    """
    return _heard(
        _palpate.fit,
        progress,
        scene,
        backend=backend,
        optimizer=optimizer,
        iterations=iterations,
        starts=starts,
        seed=seed,
        threads=threads,
        batch=batch,
        grid_check=grid_check,
        journal=journal,
        resume=resume,
    )


def diagnose(
    scene: Any,
    *,
    held_out: Any = None,
    budget: Optional[float] = None,
    backend: str = "auto",
    progress: Union[bool, Listener, None] = None,
) -> Any:
    """Finds out whether a model lacks something, where, and what; within ``budget`` minutes, where it is given.

    ``held_out`` is a scene with another recording of the same body, which no fit sees.
    """
    return _heard(_palpate.diagnose, progress, scene, held_out=held_out, budget=budget, backend=backend)


def track(scene: Any, *, progress: Union[bool, Listener, None] = None) -> Any:
    """Finds the moving body in every frame of the scene's recording, whatever moved it."""
    return _heard(_palpate.track, progress, scene)
