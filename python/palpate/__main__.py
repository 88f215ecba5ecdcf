"""The command line: ``python -m palpate fit scene.toml``, or ``palpate`` where the wheel is installed."""

from __future__ import annotations

import sys

from ._palpate import command_line


def main() -> None:
    """Runs the arguments of this process and ends it with their exit code."""
    sys.stdout.flush()
    code = command_line(["palpate", *sys.argv[1:]], sys.stderr.isatty())
    sys.exit(code)


if __name__ == "__main__":
    main()
