"""The page on plug-ins: its package is the one in the folder, its commands run, its table is what they print."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import landsim
from landsim.errors import InputError
from landsim.onboard import must_have_plug_ins

ROOT = Path(landsim.__file__).parents[1]
EXAMPLE = ROOT / "docs/examples/alpha-beta"
PAGE = (ROOT / "docs/plug-ins.md").read_text(encoding="utf-8")
PIP = "pip install docs/examples/alpha-beta"


def blocks(language: str) -> list[str]:
    fenced = [block.partition("\n") for block in re.split(r"^```", PAGE, flags=re.MULTILINE)[1::2]]
    return [text for name, _, text in fenced if name == language]


def commands() -> list[str]:
    return [line for block in blocks("") for line in block.splitlines()]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the example has been installed, as the page says but beside the environment."""
    folder = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", *shlex.split(PIP)]
    alone = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", str(folder)]
    subprocess.run([*pip, *alone], cwd=ROOT, check=True, timeout=120)
    return folder


@pytest.fixture
def work(tmp_path: Path) -> Path:
    """An empty folder from which the page's paths lead to the checkout's docs."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    return tmp_path


def run(site: Path, work: Path, *arguments: str) -> str:
    """What a command prints, run in a process of its own that finds the example; it has to end well."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=work,
        env=os.environ | {"PYTHONPATH": os.pathsep.join((str(site), str(ROOT)))},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_toml_on_the_page_is_that_of_the_files() -> None:
    files = [(EXAMPLE / name).read_text(encoding="utf-8") for name in ("pyproject.toml", "alpha-beta.toml")]
    assert blocks("toml") == files


def test_python_on_the_page_is_the_whole_of_the_module() -> None:
    """In the file's order, and all of it but the docstring at its head."""
    source = (EXAMPLE / "alpha_beta.py").read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source), clean=False)
    lines = source.replace(f'"""{docstring}"""', "").splitlines()
    shown = [line.strip() for block in blocks("python") for line in block.splitlines()]
    assert [line for line in shown if line] == [line.strip() for line in lines if line.strip()]
    for block in blocks("python"):
        assert any(textwrap.indent(block.strip(), indent) in source for indent in ("", "    "))


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#:]+)\)", PAGE))
def test_links_lead_somewhere(target: str) -> None:
    assert (ROOT / "docs" / target).exists()


@pytest.mark.parametrize(
    ("role", "name", "setting", "told"),
    [
        ("estimator", "alpha-beta", "bandwith_per_s", "bandwith_per_s; there are bandwidth_per_s, turn_share"),
        ("controller", "even-flare", "sink", "sink; there are touchdown_sink_mps"),
    ],
)
def test_a_setting_that_there_is_not(
    role: str, name: str, setting: str, told: str, site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(site))
    overrides = {f"plug-ins.{role}": name, f"plug-ins.{role}_settings.{setting}": 1.0}
    with pytest.raises(InputError, match=re.escape(f"there is no setting {told}")):
        must_have_plug_ins(landsim.load_scenario("landing", overrides))


@pytest.mark.slow
def test_the_example_lands(site: Path, work: Path) -> None:
    for name, role in (("alpha-beta", "estimator"), ("even-flare", "controller")):
        plug_in = f"plug-ins.{role}={name}"
        run(site, work, "-m", "landsim", "run", "landing", "--set", plug_in, "--no-plots", "--out", name)
        metrics = json.loads((work / name / "metrics.json").read_text(encoding="utf-8"))
        assert (metrics["outcome"], metrics["in_box"]) == ("landed", True)
        assert metrics["versions"][f"{role} {name}"].startswith("alpha-beta 0.1.0, source ")


@pytest.mark.slow
def test_commands_run(site: Path, work: Path) -> None:
    """All of the page, in its order; two flights where it has twenty, and nothing drawn."""
    assert PIP in commands()
    for line in commands():
        if line != PIP:
            program, *arguments = shlex.split(
                line.replace("-n 20", "-n 2 --no-report").replace(" run ", " run --no-plots ")
            )
            assert program == "landsim"
            run(site, work, "-m", "landsim", *arguments)
    rows = json.loads((work / "alpha-beta" / "batch.json").read_text(encoding="utf-8"))
    assert rows["versions"]["estimator alpha-beta"].startswith("alpha-beta 0.1.0, source ")


@pytest.mark.slow
def test_the_table_is_what_its_command_prints(site: Path, work: Path) -> None:
    (command,) = re.findall(r"`python (docs/examples/\S+ \d+)`", PAGE)
    printed = run(site, work, *shlex.split(command)).splitlines()
    table = [line for line in PAGE.splitlines() if line.startswith(("| landsim ", "| alpha-beta "))]
    assert [row.split("|") for row in printed[2:]] == [row.split("|") for row in table]
    assert printed[0] in PAGE
