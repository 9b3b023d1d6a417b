"""The command line: exit codes, one line on stderr, and what is and is not written."""

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import fake_flight

from landsim import __version__, cli
from landsim.config import load_scenario
from landsim.runs import read_run
from landsim.tables import number

REPOSITORY = Path(__file__).resolve().parents[1]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def landsim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], no_flying: list[int]
) -> Run:
    """Runs a command line in an empty folder, without flying: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    for variable in cli.THREAD_VARIABLES:
        monkeypatch.setenv(variable, "1")

    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            cli.main(list(arguments))
        printed = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, printed.out, printed.err

    return run


def process(*arguments: str, cwd: Path, code: str = "from landsim.cli import main; main()") -> tuple[int, str, str]:
    """The same as a process of its own, for real."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


RUN_FILES = {"scenario.toml", "log.parquet", "metrics.json", "profile.png"}


class TestRun:
    def test_writes_a_numbered_folder_and_says_so(self, landsim: Run, tmp_path: Path) -> None:
        code, out, err = landsim("run", "landing")
        assert (code, err) == (0, "")
        assert files(tmp_path) == {f"runs/001-landing/{name}" for name in RUN_FILES}
        for name in RUN_FILES:
            assert f"  runs/001-landing/{name}\n" in out
        landsim("run", "landing")
        assert {path.name for path in (tmp_path / "runs").iterdir()} == {"001-landing", "002-landing"}

    def test_table_shows_the_metrics(self, landsim: Run) -> None:
        out = landsim("run", "landing")[1]
        lines = {line.split("  ")[0].strip(): line for line in out.splitlines()}
        assert "landing, seed 0: landed, not in the box" in out
        assert "265.2 m   100 … 450 m    ok" in lines["past the threshold"]
        assert "1.25 m/s       ≤ 1 m/s   out" in lines["sink rate"]
        assert "–" in lines["heading error"]
        assert "0.250 m" in lines["along"]
        assert "1.50 m" in lines["along"]
        assert "1.20 m" in lines["off the centreline"]
        assert max(map(len, out.splitlines())) <= 100

    def test_nothing_but_text_when_piped(self, landsim: Run) -> None:
        assert "\x1b" not in landsim("run", "landing")[1]

    def test_seed_and_settings_reach_the_flight(self, landsim: Run, tmp_path: Path, no_flying: list[int]) -> None:
        code, _, _ = landsim(
            "run", "landing", "--seed", "7", "--out", "a/mine", "--no-plots",
            "--set", "runway.width_m=45", "--set", "camera.line_noise=endpoints",
        )  # fmt: skip
        assert (code, no_flying) == (0, [7])
        assert files(tmp_path) == {f"a/mine/{name}" for name in RUN_FILES - {"profile.png"}}
        flown = read_run(tmp_path / "a/mine").scenario
        assert (flown.runway.width_m, flown.camera.line_noise) == (45.0, "endpoints")

    def test_the_resolved_scenario_runs_again(self, landsim: Run, tmp_path: Path) -> None:
        landsim("run", "landing", "--out", "first", "--set", "runway.width_m=45")
        assert landsim("run", "first/scenario.toml", "--out", "second")[0] == 0
        first, second = ((tmp_path / name / "scenario.toml").read_text() for name in ("first", "second"))
        assert first.split("\n", 1)[1] == second.split("\n", 1)[1]

    def test_a_flight_that_went_wrong_is_kept(
        self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        flight = fake_flight()
        nothing = {"rms": None, "p95": None}
        flight.metrics.update(outcome="trim_failed", reason="no trim", touchdown=None, stop=None)
        flight.metrics["tracking"] = {"glide_slope_m": nothing, "localizer_m": nothing}
        monkeypatch.setattr(sys.modules["landsim.simulate"], "fly", lambda scenario, seed: flight)
        code, out, _ = landsim("run", "landing", "--out", "run")
        assert code == 0
        assert "trim_failed: no trim" in out
        assert json.loads((tmp_path / "run/metrics.json").read_text())["touchdown"] is None


BAD = {
    "no command": [],
    "unknown command": ["fly"],
    "unknown option": ["run", "landing", "--sed", "1"],
    "missing scenario": ["run"],
    "one argument too many": ["run", "landing", "landing"],
    "missing file": ["run", "nowhere.toml"],
    "unknown scenario": ["run", "landnig"],
    "unknown key": ["run", "landing", "--set", "runway.widht_m=30.0"],
    "wrong type": ["run", "landing", "--set", 'runway.width_m="30"'],
    "negative width": ["run", "landing", "--set", "runway.width_m=-30.0"],
    "not a number": ["run", "landing", "--set", "start.height_m=nan"],
    "zero focal length": ["run", "landing", "--set", "camera.focal_length_mm=0.0"],
    "unknown aircraft": ["run", "landing", "--set", "aircraft.name=pionier"],
    "a study": ["run", "landing", "--set", "kind=study"],
    "not a setting": ["run", "landing", "--set", "width"],
    "negative seed": ["run", "landing", "--seed", "-1"],
    "fractional seed": ["run", "landing", "--seed", "1.5"],
    "folder below a file": ["run", "landing", "--out", "file/x/y"],
    "folder is a file": ["run", "landing", "--out", "file"],
    "folder is not empty": ["run", "landing", "--out", "full"],
    "folder holds a run": ["run", "landing", "--out", "done"],
    "check: unknown key": ["check", "landing", "--set", "box.width_m=1"],
    "check: broken file": ["check", "file"],
    "plot: no folder": ["plot", "nowhere"],
    "plot: not a run": ["plot", "full"],
}
TOLD = {
    "no command": "Missing command",
    "missing file": "nowhere.toml: no such scenario file",
    "unknown scenario": "did you mean landing?",
    "unknown key": "landing.toml: override runway.widht_m: unknown key; did you mean runway.width_m?",
    "wrong type": 'override runway.width_m: must be a number, not "30"',
    "negative width": "override runway.width_m: must be above 0, not -30.0",
    "not a number": "override start.height_m: must be a finite number, not nan",
    "zero focal length": "override camera.focal_length_mm: must be above 0, not 0.0",
    "unknown aircraft": "override aircraft.name: no aircraft \"pionier\": neither a folder nor a shipped name; did you",
    "a study": 'kind: must be "flight" to be run, not "study"',
    "negative seed": "'--seed': -1",
    "fractional seed": "'--seed': '1.5'",
    "folder below a file": "file/x/y: cannot be written",
    "folder is a file": "file: is a file",
    "folder is not empty": "full: is not empty",
    "folder holds a run": "done: already holds a run",
    "check: broken file": "file: not valid TOML",
    "plot: not a run": "full: is not a run: scenario.toml is missing",
}  # fmt: skip


class TestBadInput:
    @pytest.mark.parametrize("case", BAD)
    def test_is_one_line_and_nothing_is_written_or_lost(
        self, case: str, landsim: Run, tmp_path: Path, no_flying: list[int]
    ) -> None:
        (tmp_path / "file").write_text("mine = \n")
        for name in ("full/other", "done/metrics.json"):
            (tmp_path / name).parent.mkdir()
            (tmp_path / name).write_text("mine")
        before = {path: path.read_text() for path in tmp_path.rglob("*") if path.is_file()}
        code, out, err = landsim(*BAD[case])
        assert (code, out) == (2, "")
        assert err.startswith("landsim: ")
        assert err.endswith("\n")
        assert len(err.splitlines()) == 1
        assert TOLD.get(case, "") in err
        assert {path: path.read_text() for path in tmp_path.rglob("*") if path.is_file()} == before
        assert {path.name for path in tmp_path.iterdir()} == {"file", "full", "done"}
        assert no_flying == []

    def test_told_by_a_process_of_its_own(self, tmp_path: Path) -> None:
        code, out, err = process("run", "landing", "--set", "runway.widht_m=1", cwd=tmp_path)
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert "did you mean runway.width_m?" in err
        assert list(tmp_path.iterdir()) == []


class TestFailures:
    def fail_with(self, failure: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
        def fly(scenario: Any, seed: int) -> None:
            raise failure

        monkeypatch.setattr(sys.modules["landsim.simulate"], "fly", fly)

    def test_of_ours_is_told_as_ours(self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("LANDSIM_DEBUG", raising=False)
        self.fail_with(ZeroDivisionError("division\nby zero"), monkeypatch)
        code, out, err = landsim("run", "landing", "--out", "a/run")
        assert (code, out, len(err.splitlines())) == (1, "", 1)
        assert "ZeroDivisionError: division\\nby zero" in err
        assert "LANDSIM_DEBUG=1" in err
        assert list(tmp_path.iterdir()) == []

    def test_with_debugging_it_is_not_caught(
        self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("LANDSIM_DEBUG", "1")
        self.fail_with(ZeroDivisionError(), monkeypatch)
        with pytest.raises(ZeroDivisionError):
            cli.main(["run", "landing"])
        assert list(tmp_path.iterdir()) == []

    def test_an_interrupt_is_quiet(self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.fail_with(KeyboardInterrupt(), monkeypatch)
        code, out, err = landsim("run", "landing")
        assert (code, out, err.strip()) == (130, "", "")
        assert list(tmp_path.iterdir()) == []


class TestOtherCommands:
    def test_list(self, landsim: Run) -> None:
        code, out, err = landsim("list")
        assert (code, err) == (0, "")
        assert "  landing  One landing in calm air" in out
        assert "  pioneer  " in out

    def test_check_prints_a_file_that_loads_to_the_same(self, landsim: Run, tmp_path: Path) -> None:
        code, out, _ = landsim("check", "landing", "--set", "camera.rate_hz=15")
        assert code == 0
        assert tomllib.loads(out)["camera"]["rate_hz"] == 15.0
        (tmp_path / "again.toml").write_text(out)
        assert load_scenario(tmp_path / "again.toml").camera == load_scenario("landing", {"camera.rate_hz": 15}).camera

    def test_check_takes_a_study(self, landsim: Run) -> None:
        assert landsim("check", "landing", "--set", "kind=study")[0] == 0

    def test_plot_draws_into_the_run(self, landsim: Run, tmp_path: Path) -> None:
        landsim("run", "landing", "--out", "mine", "--no-plots")
        code, out, _ = landsim("plot", "mine")
        assert (code, out) == (0, "  mine/profile.png\n")
        assert files(tmp_path / "mine") == RUN_FILES

    def test_version(self, landsim: Run) -> None:
        assert landsim("--version") == (0, f"landsim, version {__version__}\n", "")

    @pytest.mark.parametrize("command", [[], ["list"], ["check"], ["run"], ["plot"]])
    def test_help(self, command: list[str], landsim: Run) -> None:
        code, out, err = landsim(*command, "--help")
        assert (code, err) == (0, "")
        assert out.startswith("Usage: landsim")


HEAVY = {"numpy", "scipy", "pydantic", "rich", "pyarrow", "matplotlib", "filterpy", "jsbsim"}


class TestImports:
    """Found by what a process has imported, so that no clock decides."""

    def imported(self, code: str, tmp_path: Path) -> set[str]:
        report = "import sys, atexit; atexit.register(lambda: print('IMPORTED', *sys.modules))\n"
        exit_code, out, err = process(cwd=tmp_path, code=report + code)
        assert exit_code == 0, err
        return set(out.rsplit("IMPORTED", 1)[1].split())

    @pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["--version"], ["list"]])
    def test_what_needs_no_library_imports_none(self, arguments: list[str], tmp_path: Path) -> None:
        assert not HEAVY & self.imported(f"from landsim.cli import main; main({arguments})", tmp_path)

    def test_the_package_itself_is_light(self, tmp_path: Path) -> None:
        assert not HEAVY & self.imported("import landsim", tmp_path)

    def test_check_does_not_wait_for_the_simulation(self, tmp_path: Path) -> None:
        imported = self.imported("from landsim.cli import main; main(['check', 'landing'])", tmp_path)
        assert not imported & {"numpy", "jsbsim", "filterpy", "matplotlib", "pyarrow"}

    def test_the_controller_cannot_see_the_truth(self, tmp_path: Path) -> None:
        imported = self.imported("import landsim.guidance, landsim.navigation", tmp_path)
        assert not imported & {"landsim.truth", "landsim.plant", "landsim.sensors", "landsim.simulate", "jsbsim"}

    def test_the_estimator_stands_alone(self, tmp_path: Path) -> None:
        imported = self.imported("import estimator", tmp_path)
        assert not {name for name in imported if name.startswith("landsim")}
        assert not imported & {"jsbsim", "matplotlib", "filterpy", "pydantic"}

    def test_threads_are_settled_before_numpy(self, tmp_path: Path) -> None:
        code = (
            "import os, sys\nos.environ['OPENBLAS_NUM_THREADS'] = '8'\nfrom landsim.cli import main\n"
            "assert 'numpy' not in sys.modules\ntry:\n    main(['list'])\n"
            "finally:\n    assert os.environ['OPENBLAS_NUM_THREADS'] == '1' == os.environ['OMP_NUM_THREADS']\n"
        )
        assert process(cwd=tmp_path, code=code)[0] == 0


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(None, "m", "–"), (0.12345, "m", "0.123 m"), (-1.5, "°", "-1.50°"), (265.123, "m", "265.1 m"), (3.0, "", "3.00")],
)
def test_number(value: float | None, unit: str, text: str) -> None:
    assert number(value, unit) == text
