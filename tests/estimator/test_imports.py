"""What importing the estimator costs, and what its front door offers."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_heavy_libraries_stay_out() -> None:
    code = "import sys, estimator; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(result.stdout.split())
    assert "numpy" in loaded
    assert not loaded & {"filterpy", "numba", "matplotlib", "jsbsim", "scipy", "pydantic", "pyarrow", "landsim"}


def test_public_names() -> None:
    import estimator

    for name in ("PinholeCamera", "three_line_pose", "two_line_pose"):
        assert name in estimator.__all__
        assert callable(getattr(estimator, name))
