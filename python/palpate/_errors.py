"""What can go wrong. Every exception knows the file, line and key that are meant, and what may help, where there are such."""

from __future__ import annotations

from typing import Any, Optional


class PalpateError(Exception):
    """Something went wrong; the message says what, where, and what is allowed or may help.

    Attributes:
        file: the file that is meant, or None. Arrays that were given in memory are called ``<arrays>``.
        line: its line, counted from 1, or None.
        key: the dotted path of the key in it, or the name of the argument, or None.
        hint: what may help, or None.
    """

    def __init__(
        self,
        message: str,
        file: Optional[str] = None,
        line: Optional[int] = None,
        key: Optional[str] = None,
        hint: Optional[str] = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.key = key
        self.hint = hint


class SceneError(PalpateError, ValueError):
    """Something is wrong with a scene, or with a file that it names."""


class RecordingError(PalpateError, ValueError):
    """Something is wrong with a recording."""


class ArgumentError(PalpateError, ValueError):
    """An argument is wrong; ``key`` is its name."""


class ComputationError(PalpateError, RuntimeError):
    """The input is fine, but the computation failed."""


class SimulationError(ComputationError):
    """A simulation failed; ``time`` [s] says when, where it had begun."""

    def __init__(self, message: str, time: Optional[float] = None, **attributes: Any) -> None:
        super().__init__(message, **attributes)
        self.time = time


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a fit; ``result`` is the best so far as a Fit, or None where there was nothing yet."""

    def __init__(self, result: Any = None) -> None:
        super().__init__("interrupted")
        self.result = result
