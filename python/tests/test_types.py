"""The stubs are what the library is, and what the tests use of it is typed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import palpate


def test_tests_and_package_are_typed(root: Path) -> None:
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", "tests"]
    done = subprocess.run(command, cwd=root / "python", capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_stubs_say_what_there_is(root: Path, tmp_path: Path) -> None:
    # Names that begin with an underscore are nobody's business; what is logged to Rerun is typed where it stands.
    allowed = tmp_path / "allowed.txt"
    allowed.write_text("palpate\\._.*\npalpate\\.__main__\npalpate\\.rerun_log\n")
    command = [sys.executable, "-m", "mypy.stubtest", "palpate", "--ignore-missing-stub", "--allowlist", str(allowed)]
    command += ["--ignore-unused-allowlist", "--ignore-disjoint-bases", "--mypy-config-file", str(root / "python/pyproject.toml")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_says_that_it_is_typed() -> None:
    folder = Path(palpate.__file__).parent
    assert (folder / "py.typed").exists()
    assert (folder / "__init__.pyi").exists()
