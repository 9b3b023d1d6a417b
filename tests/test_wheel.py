"""The wheel: built from the sdist, installed elsewhere and run from the root of the file system."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


def run(*command: str, **environment: str) -> str:
    """What a command prints, run from /."""
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        command, cwd="/", env=inherited | environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_wheel_from_sdist_runs_from_anywhere(tmp_path: Path) -> None:
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(REPOSITORY))
    (wheel,) = tmp_path.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    for path in [*REPOSITORY.glob("scenarios/*.toml"), *REPOSITORY.glob("aircraft/*/**/*.*")]:
        assert f"landsim/_data/{path.relative_to(REPOSITORY).as_posix()}" in names
    assert {"landsim/py.typed", "estimator/py.typed", "landsim/page/templates/page.html.j2"} <= names
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == {"estimator", "landsim"}

    site = tmp_path / "site"
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-index", "--no-deps")
    run(*pip, "--target", str(site), str(wheel))
    landsim = str(site / "bin" / "landsim")
    where = run(sys.executable, "-c", "import landsim; print(landsim.__file__)", PYTHONPATH=str(site))
    assert Path(where.strip()) == site / "landsim" / "__init__.py"
    assert "landing" in run(landsim, "list", PYTHONPATH=str(site))
    out = tmp_path / "run"
    run(landsim, "run", "landing", "--out", str(out), PYTHONPATH=str(site))
    assert json.loads((out / "metrics.json").read_text())["outcome"] == "landed"
    assert len(list(out.glob("*.png"))) >= 4
