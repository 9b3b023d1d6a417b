"""The command line: exit codes, one line on stderr, and what is and is not written."""

import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
import weakref
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from conftest import fake_flight
from flown import around, good
from reported import summary
from rich.console import Console

from landsim import __version__, cli
from landsim.batch.folder import SCENARIO_FILE
from landsim.config import load_scenario
from landsim.plain import as_json
from landsim.runs import read_run
from landsim.tables import batch_tables, flight_tables, number
from landsim.terminal import terminable
from landsim.threads import THREAD_VARIABLES

REPOSITORY = Path(__file__).resolve().parents[1]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def landsim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], no_flying: list[int]
) -> Run:
    """Runs a command line in an empty folder, without flying: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    for variable in THREAD_VARIABLES:
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
        assert out.splitlines()[:2] == ["runs/001-landing", "landing, seed 0: landed, not in the box"]
        # the room is that to the nearer end
        assert " ".join(lines["past the threshold"].split()[3:]) == "265.2 m 100 … 450 m 165.2 m ok"
        assert "± 2 m" in lines["right of the centreline"]
        assert " ".join(lines["sink rate"].split()[2:]) == "1.25 m/s ≤ 1 m/s -0.250 m/s out"
        assert "–" in lines["heading error"]
        assert lines["along, m"].split() == ["along,", "m", "0.250", "0.500", "1.50", "3.00", "0.125", "0.750"]
        assert "640 to 645 frames that have both" in out
        assert "1.20 m" in lines["off the centreline"]
        tracking = [line.split("  ")[0].strip() for line in out.splitlines() if line.startswith(" off the")]
        assert tracking == ["off the glide slope", "off the glide slope, to the flare", "off the centreline"]
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
        assert first.split("\n", 2)[2] == second.split("\n", 2)[2]

    def test_a_run_is_flown_again_from_its_folder(self, landsim: Run, tmp_path: Path, no_flying: list[int]) -> None:
        landsim("run", "landing", "--seed", "7", "--out", "first", "--set", "runway.width_m=45")
        assert landsim("run", "first")[0] == 0
        assert landsim("run", "first", "--seed", "8", "--set", "runway.width_m=40")[0] == 0
        assert no_flying == [7, 7, 8]
        again, other = (read_run(tmp_path / "runs" / name) for name in ("001-landing", "002-landing"))
        assert again.scenario.runway.width_m == 45.0
        assert other.scenario.runway.width_m == 40.0
        texts = [(tmp_path / name / "scenario.toml").read_text() for name in ("first", "runs/001-landing")]
        assert texts[0] == texts[1]

    def test_a_name_with_a_newline_stays_on_its_line(self, landsim: Run, tmp_path: Path) -> None:
        (tmp_path / "x\ny.toml").write_text('kind = "flight"\naircraft.name = "pioneer"\n')
        code, out, _ = landsim("run", "x\ny.toml", "--out", "a\nb")
        assert code == 0
        assert out.startswith("a\\nb\nx\\ny, seed 0: ")
        assert "  a\\nb/log.parquet\n" in out
        assert landsim("run", "a\nb", "--out", "again")[0] == 0
        assert read_run(tmp_path / "again").scenario.name == "x\ny"
        assert landsim("check", "x\ny.toml")[1].startswith("# x\\ny: ")

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
    "out is not text": ["run", "landing", "--out", "\udcff/a"],
    "no name": ["check", ""],
    "empty key": ["check", "landing", "--set", "..=3"],
    "setting is not text": ["check", "landing", "--set", "\udcff=3"],
    "seed is a word": ["run", "landing", "--seed", "x"],
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
    "a study": 'study: is missing, which kind = "study" needs',
    "negative seed": "'--seed': must be a whole number, 0 or more, not -1",
    "fractional seed": "'--seed': must be a whole number, 0 or more, not 1.5",
    "seed is a word": "'--seed': must be a whole number, 0 or more, not x",
    "out is not text": "must be UTF-8 text",
    "no name": "no scenario named",
    "empty key": "the key has an empty part",
    "setting is not text": "must be UTF-8 text",
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

    def test_an_interrupt_is_a_line(self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.fail_with(KeyboardInterrupt(), monkeypatch)
        assert landsim("run", "landing") == (130, "", "landsim: interrupted\n")
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    @pytest.mark.parametrize("longest", [0.0, 20.0])
    def test_an_interrupt_that_python_drops_is_not_lost(
        self,
        number: signal.Signals,
        longest: float,
        landsim: Run,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """Raised in the callback of a weak reference: again a little later, or where the command would have ended."""

        def interrupted(_: object) -> None:
            signal.raise_signal(number)
            for _ in range(1000):
                pass
            raise AssertionError("it went on")

        def fly(scenario: Any, seed: int) -> Any:
            one = {0}.union()
            watched = weakref.ref(one, interrupted)
            del one
            assert watched() is None
            end = time.monotonic() + longest
            while time.monotonic() < end:
                time.sleep(0.01)
            return fake_flight()

        monkeypatch.setattr(sys.modules["landsim.simulate"], "fly", fly)
        begin = time.monotonic()
        code, _, err = landsim("run", "landing")
        assert (code, err) == (130, "landsim: interrupted\n")
        assert time.monotonic() - begin < 15.0
        assert signal.getsignal(signal.SIGINT) == signal.default_int_handler

    def test_one_that_is_taken_for_something_else(self, landsim: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        def fly(scenario: Any, seed: int) -> None:
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                raise RuntimeError("something failed") from None

        monkeypatch.setattr(sys.modules["landsim.simulate"], "fly", fly)
        assert landsim("run", "landing") == (130, "", "landsim: interrupted\n")

    def test_a_later_signal_counts_again(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now = 0.0
        monkeypatch.setattr("landsim.terminal.time", SimpleNamespace(monotonic=lambda: now))
        taken = []
        with pytest.raises(KeyboardInterrupt), terminable():
            for now in (0.0, 0.5, 2.0, 2.5, 4.0):
                try:
                    signal.raise_signal(signal.SIGTERM)
                except KeyboardInterrupt:
                    taken.append(now)
        assert taken == [0.0, 2.0, 4.0]

    @pytest.mark.parametrize("command", ["check", "run"])
    def test_a_model_that_jsbsim_refuses(
        self, command: str, landsim: Run, aircraft_copy: Callable[[str], Path], no_flying: list[int]
    ) -> None:
        for path in (aircraft_copy("engb") / "Engines").glob("*.xml"):
            path.write_text("<broken")
        code, out, err = landsim(command, "landing", "--set", "aircraft.name=./engb")
        assert (code, out, len(err.splitlines()), no_flying) == (2, "", 1, [])
        assert "JSBSim refuses it" in err

    def test_a_working_directory_that_is_gone(self, landsim: Run, tmp_path: Path) -> None:
        (tmp_path / "gone").mkdir()
        os.chdir(tmp_path / "gone")
        (tmp_path / "gone").rmdir()
        code, out, err = landsim("run", "landing", "--out", str(tmp_path / "run"))
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert "the working directory is not there any more" in err

    @pytest.mark.parametrize("command", ["run", "check", "batch", "budget"])
    def test_the_folder_of_a_batch(self, command: str, landsim: Run, tmp_path: Path) -> None:
        (tmp_path / "day").mkdir()
        (tmp_path / "day" / "batch.json").write_text("{}")
        code, out, err = landsim(command, "day")
        assert (code, out) == (2, "")
        assert err == f"landsim: day: is the folder of a batch, not a scenario; did you mean day/{SCENARIO_FILE}?\n"

    def test_a_disk_that_is_full_where_nobody_looked(self, landsim: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        self.fail_with(OSError(errno.ENOSPC, "No space left on device", "cache/x"), monkeypatch)
        told = "landsim: cache/x: cannot be written: No space left on device\n"
        assert landsim("run", "landing") == (2, "", told)

    def test_plot_of_other_metrics(self, landsim: Run, tmp_path: Path) -> None:
        landsim("run", "landing", "--out", "mine")
        (tmp_path / "mine/metrics.json").write_text('{"scenario": "x"}')
        code, _, err = landsim("plot", "mine")
        assert (code, err) == (2, "landsim: mine: is not a run: metrics.json: seed is missing\n")

    def test_sigterm_interrupts_and_leaves_nothing(
        self, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fly(scenario: Any, seed: int) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            raise AssertionError("it went on")

        monkeypatch.setattr(sys.modules["landsim.simulate"], "fly", fly)
        assert landsim("run", "landing")[0] == 130
        assert list(tmp_path.iterdir()) == []
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


class TestOutput:
    """What becomes of a run that is kept when nobody can read of it."""

    CODE = (
        "import sys, types\nfrom pathlib import Path\nsys.path.insert(0, {tests!r})\nfrom conftest import fake_flight\n"
        "simulate = types.ModuleType('landsim.simulate')\nsimulate.fly = lambda scenario, seed: fake_flight()\n"
        "sys.modules['landsim.simulate'] = simulate\nfrom landsim.cli import main\n"
        "main(['run', 'landing', '--no-plots', '--out', 'run'])\n"
    ).format(tests=str(REPOSITORY / "tests"))

    def shell(self, line: str, cwd: Path, **environment: str) -> tuple[int, bytes, bytes]:
        """A line of bash, in which $RUN is a run."""
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", line.replace("$RUN", f'{sys.executable} -c "$CODE"')],
            cwd=cwd,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY), "CODE": self.CODE} | environment,
            capture_output=True,
            timeout=60,
            check=False,
        )
        assert files(cwd) == {f"run/{name}" for name in RUN_FILES - {"profile.png"}}
        return done.returncode, done.stdout, done.stderr

    def test_a_reader_who_has_gone(self, tmp_path: Path) -> None:
        assert self.shell("$RUN | head -1", tmp_path) == (0, b"run\n", b"")

    def test_a_full_disk(self, tmp_path: Path) -> None:
        code, _, err = self.shell("$RUN > /dev/full", tmp_path)
        assert (code, len(err.splitlines())) == (0, 1)
        assert err.startswith(b"landsim: run: the run is there; ")

    @pytest.mark.parametrize("line", ["$RUN >&-", "$RUN >&- 2>&-", "$RUN >/dev/full 2>/dev/full"])
    def test_nowhere_to_write(self, line: str, tmp_path: Path) -> None:
        assert self.shell(line, tmp_path) == (0, b"", b"")

    def test_a_terminal_of_ascii(self, tmp_path: Path) -> None:
        code, out, err = self.shell("$RUN", tmp_path, PYTHONIOENCODING="ascii")
        assert (code, err) == (0, b"")
        assert out.isascii()
        lines = out.decode().splitlines()
        (bank,) = [line for line in lines if "right of the centreline" in line and "+/-" in line]
        (sink,) = [line for line in lines if "sink rate" in line]
        assert "100 ... 450 m" in out.decode()
        assert "<= 1 m/s" in sink
        assert len(bank) == len(sink)
        assert "?" not in out.decode()


class TestTables:
    def printed(self, width: int, metrics: dict[str, Any]) -> str:
        console = Console(width=width, file=io.StringIO())
        with console.capture() as text:
            for table in flight_tables(metrics, width):
                console.print(table, crop=False)
        return text.get()

    def test_what_was_not_reached_is_not_out(self) -> None:
        metrics = as_json(fake_flight().metrics)
        metrics |= {"touchdown": None, "stop": None, "outcome": "diverged", "reason": "the filter diverged"}
        metrics["box"] = {key: of | {"value": None, "ok": False, "margin": None} for key, of in metrics["box"].items()}
        text = self.printed(100, metrics)
        assert re.search("\u2013  100 … 450 m +not reached", text)
        assert " out" not in text

    def test_why_a_flight_came_to_nothing(self) -> None:
        """A batch of one, in the table of the worst."""
        flight = {"index": 0, "outcome": "error", "in_box": False, "limit": None}
        for reason, told in (
            ("took longer than the limit of 60 s of wall time", "time limit"),
            ("RuntimeError: wings fell off", "RuntimeError: wings fell off"),
            ("RuntimeError: the wings fell off", "RuntimeError: the wings f..."),
        ):
            summary = {
                "batch": {"scenario": "landing", "n": 1, "seed": 0, "confidence": 0.95},
                "rates": {
                    "success": {"rate": 0.0, "low": 0.0, "high": 0.975},
                    "gone_around": {"count": 0},
                    "outcomes": [],
                },
                "verdict": {"limits": []},
                "distributions": [],
                "worst": {"flights": [flight | {"reason": reason}]},
            }
            console = Console(width=40, file=io.StringIO())
            with console.capture() as captured:
                for table in batch_tables(summary, 40):
                    console.print(table, crop=False)
            text = captured.get()
            assert "landing, 1 flight from seed 0 on" in text
            assert told in text
            assert max(map(len, text.splitlines())) <= 40

    @pytest.mark.parametrize("width", [100, 60, 44])
    def test_a_batch_has_its_go_arounds_and_the_room_to_its_limits(self, width: int) -> None:
        rows = [*(good(i, y_m=-2.5 if i == 3 else 0.0, in_box=i != 3) for i in range(9)), around(9)]
        console = Console(width=width, file=io.StringIO())
        with console.capture() as captured:
            for table in batch_tables(summary(rows), width):
                console.print(table, crop=False)
        text = captured.get()
        assert max(map(len, text.splitlines())) <= width
        words = " ".join(text.split())
        assert "10 % (0.2529 … 44.5) went around, which is neither a landing nor a failure" in words
        assert "1 of 9" in words
        assert "-0.500 m" in words
        if width == 100:
            (line,) = [line for line in text.splitlines() if line.startswith(" |lateral touchdown| ")][:1]
            assert line.split()[2:] == ["≤", "2", "m", "1", "of", "9", "–", "-0.500", "m"]

    @pytest.mark.parametrize("width", [100, 60, 44, 40])
    def test_nothing_is_cut_at_any_width(self, width: int) -> None:
        metrics = as_json(fake_flight().metrics)
        for figures in metrics["navigation"].values():
            for of in figures.values():
                of |= {"rms": 12345.6, "paired_rms": 77.25}
        text = self.printed(width, metrics)
        assert "…" not in text.replace(" … ", "")
        for word in ("265.2 m", "100 … 450 m", "ok", "out", "± 2 m", "≤ 1 m/s", "12345.6", "vision", "threshold"):
            assert word in text
        words = " ".join(text.split())
        assert "77.25" in text
        assert "640 to 645 frames that have both" in words
        assert max(map(len, text.splitlines())) <= width


class TestPythonM:
    def test_landsim(self, tmp_path: Path) -> None:
        code = (
            "import runpy, sys\nsys.argv = ['landsim', '--version']\nrunpy.run_module('landsim', run_name='__main__')"
        )
        assert process(cwd=tmp_path, code=code)[:2] == (0, f"landsim, version {__version__}\n")

    @pytest.mark.parametrize("arguments", [["nosuch"], ["--help"], ["pioneer", "pioneer"]])
    def test_modes_of_no_aircraft(self, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
        from landsim import modes

        assert modes.main(arguments) == 2
        printed = capsys.readouterr()
        assert (printed.out, len(printed.err.splitlines())) == ("", 1)

    def test_modes(self, capsys: pytest.CaptureFixture[str]) -> None:
        from landsim import modes

        assert modes.main(["pioneer"]) == 0
        assert "| phugoid |" in capsys.readouterr().out


class TestOtherCommands:
    def test_list(self, landsim: Run) -> None:
        code, out, err = landsim("list")
        assert (code, err) == (0, "")
        told = [line.split(maxsplit=1) for line in out.splitlines() if line.startswith("  ")]
        assert dict(told)["landing"].startswith("One landing in calm air")
        assert dict(told)["paper-fig3"].startswith("The paper's Fig. 3")
        assert "  pioneer  " in out

    def test_check_prints_a_file_that_loads_to_the_same(self, landsim: Run, tmp_path: Path) -> None:
        code, out, _ = landsim("check", "landing", "--set", "camera.rate_hz=15")
        assert code == 0
        assert tomllib.loads(out)["camera"]["rate_hz"] == 15.0
        (tmp_path / "again.toml").write_text(out)
        assert load_scenario(tmp_path / "again.toml").camera == load_scenario("landing", {"camera.rate_hz": 15}).camera

    def test_check_takes_a_study(self, tmp_path: Path) -> None:
        code, out, _ = process("check", "paper-fig3", cwd=tmp_path)
        assert code == 0
        assert tomllib.loads(out)["study"]["draws"] == 1000

    def test_plot_draws_into_the_run(self, landsim: Run, tmp_path: Path) -> None:
        landsim("run", "landing", "--out", "mine", "--no-plots")
        code, out, _ = landsim("plot", "mine")
        assert (code, out) == (0, "  mine/profile.png\n")
        assert files(tmp_path / "mine") == RUN_FILES

    def test_version(self, landsim: Run) -> None:
        assert landsim("--version") == (0, f"landsim, version {__version__}\n", "")

    @pytest.mark.parametrize(
        "command", [[], ["list"], ["check"], ["run"], ["batch"], ["merge"], ["replay"], ["compare"], ["plot"]]
    )
    def test_help(self, command: list[str], landsim: Run) -> None:
        code, out, err = landsim(*command, "--help")
        assert (code, err) == (0, "")
        assert out.startswith("Usage: landsim")


HEAVY = {"numpy", "numba", "scipy", "pydantic", "rich", "pyarrow", "matplotlib", "filterpy", "jsbsim", "distributed"}


class TestImports:
    """Found by what a process has imported, so that no clock decides."""

    def imported(self, code: str, tmp_path: Path) -> set[str]:
        report = "import sys, atexit; atexit.register(lambda: print('IMPORTED', *sys.modules))\n"
        exit_code, out, err = process(cwd=tmp_path, code=report + code)
        assert exit_code == 0, err
        return set(out.rsplit("IMPORTED", 1)[1].split())

    @pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["batch", "--help"], ["--version"], ["list"]])
    def test_what_needs_no_library_imports_none(self, arguments: list[str], tmp_path: Path) -> None:
        assert not HEAVY & self.imported(f"from landsim.cli import main; main({arguments})", tmp_path)

    def test_the_package_itself_is_light(self, tmp_path: Path) -> None:
        assert not HEAVY & self.imported("import landsim", tmp_path)

    def test_check_loads_the_model_without_the_filter_and_pictures(self, tmp_path: Path) -> None:
        imported = self.imported("from landsim.cli import main; main(['check', 'landing'])", tmp_path)
        assert not imported & {"filterpy", "matplotlib", "pyarrow", "scipy.linalg"}
        assert "jsbsim" in imported

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
