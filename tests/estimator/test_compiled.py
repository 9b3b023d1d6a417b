"""Compiled code is that of the sources, and of all of them."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from estimator.compiled import digest
from estimator.strapdown import euler

ROOT = Path(__file__).parents[2]
CODE = """
import numpy as np
from estimator.strapdown import euler
level = np.zeros(18)
level[[6, 10, 14]] = 1.0
roll, pitch, yaw = euler(level)
print(roll, *euler.stats.cache_hits.values())
"""


def run(folder: Path) -> list[float]:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    environment.pop("NUMBA_CACHE_DIR", None)
    result = subprocess.run(
        [sys.executable, "-c", CODE], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return [float(number) for number in result.stdout.split()]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "estimator", tmp_path / "estimator", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_code_is_kept_until_a_function_that_it_calls_changes(copy: Path) -> None:
    assert run(copy) == [0.0]
    assert run(copy) == [0.0, 1.0], "the second process compiles nothing"
    module = copy / "estimator" / "so3.py"
    text = module.read_text(encoding="utf-8")
    changed = text.replace("math.atan2(a[7], a[8]),\n", "math.atan2(a[7], a[8]) + 1000.0,\n")
    assert changed != text
    module.write_text(changed, encoding="utf-8")
    later = time.time() + 10.0
    os.utime(module, (later, later))
    assert run(copy) == [1000.0], "euler stands in another module, and holds the code of to_euler"


def test_digest_sees_constants_and_calls() -> None:
    scope: dict[str, object] = {"K": 1.0}
    exec("def inner(x):\n    return K * x\ndef outer(x):\n    return inner(x) + 1.0\n", scope)
    outer = scope["outer"]
    assert callable(outer)
    first = digest(outer)
    assert digest(outer) == first
    scope["K"] = 2.0
    assert digest(outer) != first
    scope["K"] = 1.0
    exec("def inner(x):\n    return K + x\n", scope)
    assert digest(outer) != first


def test_digest_is_the_same_in_another_process() -> None:
    code = "from estimator.compiled import digest; from estimator.strapdown import euler; print(digest(euler.py_func))"
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == digest(euler.py_func)  # type: ignore[attr-defined]
