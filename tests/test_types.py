"""The type checker finds nothing wrong. A test, so that it runs beside the others."""

import subprocess
import sys


def test_types_are_right() -> None:
    mypy = [sys.executable, "-m", "mypy"]
    found = subprocess.run(mypy, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
