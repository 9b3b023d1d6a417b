"""Batches by the command line: what is printed, written and refused, and what an interrupt leaves."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from batches import SHORT, same, table

from landsim import cli
from landsim.runs import read_run
from landsim.terminal import FlightRate, flight_progress

REPOSITORY = Path(__file__).resolve().parents[1]
SETTINGS = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def landsim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line in an empty folder: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            cli.main(list(arguments))
        printed = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, printed.out, printed.err

    return run


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six short flights with their report left out."""
    folder = tmp_path_factory.mktemp("flown")
    batch = begin("landing", *SETTINGS, "-n", "6", "--workers", "2", "--no-report", "--out", "whole", cwd=folder)
    out, err = batch.communicate(timeout=120)
    assert batch.returncode == 0, err
    assert "6 flights in" in err
    assert "whole\nlanding, 6 flights from seed 0 on: 0 % (0 … 45.93) in the box" in out
    return folder / "whole"


def begin(*arguments: str, cwd: Path) -> "subprocess.Popen[str]":
    """``landsim batch`` as a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "landsim", "batch", *arguments],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def when_chunks(folder: Path, count: int, process: "subprocess.Popen[str]") -> None:
    """Wait until so many chunks have been written."""
    for _ in range(6000):
        if len(list(folder.glob("chunks/*.parquet"))) >= count:
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    pytest.fail("no chunks")


def copied(flown: Path, to: Path, *more: str) -> Path:
    """A batch in another folder, without its summary."""
    to.mkdir()
    for name in ("batch.json", "flights.parquet", "scenario.toml", *more):
        (to / name).write_bytes((flown / name).read_bytes())
    return to


def kept(folder: Path) -> int:
    return sum(pq.read_metadata(path).num_rows for path in folder.glob("chunks/*.parquet"))


class TestBatch:
    def test_what_is_written(self, flown: Path) -> None:
        names = {path.name for path in flown.iterdir()}
        assert names == {".lock", "batch.json", "flights.parquet", "scenario.toml", "summary.json"}
        assert table(flown)["seed"].to_pylist() == list(range(6))
        summary = json.loads((flown / "summary.json").read_text())
        assert summary["batch"]["n"] == 6
        assert summary["rates"]["success"]["count"] == 0

    def test_resumed_it_grows_and_shards_merge_to_the_same(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        common = ("batch", "landing", *SETTINGS, "--no-report", "--workers", "1", "--out")
        for shard in ("1/2", "2/2"):
            code, out, _ = landsim(*common, shard[0], "-n", "6", "--shard", shard)
            assert code == 0
            assert f"shard {shard} is complete; with the others: landsim merge {shard[0]} DIR..." in out
        code, out, _ = landsim("merge", "1", "2", "--no-report")
        assert (code, out.splitlines()[0]) == (0, "runs/001-landing")
        same(tmp_path / "runs" / "001-landing", flown)
        code, out, _ = landsim(*common, "grown", "-n", "4", "--keep", "all")
        assert code == 0
        code, _, err = landsim(*common, "grown", "-n", "6", "--resume")
        assert code == 0
        assert err.splitlines()[-1].startswith("landsim: 2 flights in ")
        same(tmp_path / "grown", flown)
        assert {path.name for path in (tmp_path / "grown" / "kept").iterdir()} == set("012345")
        assert read_run(tmp_path / "grown" / "kept" / "5").metrics["seed"] == 5

    def test_a_report_now_or_later(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        copied(flown, tmp_path / "copy")
        code, out, _ = landsim("plot", "copy")
        assert code == 0
        assert "  copy/report.html\n  copy/report.md\n" in out
        assert (tmp_path / "copy" / "summary.json").is_file()

    def test_two_batches_are_compared(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        more = ("--set", "camera.noise_px=0.4", "--no-report", "--workers", "1", "--out", "finer")
        assert landsim("batch", "landing", *SETTINGS, "-n", "5", *more)[0] == 0
        code, out, _ = landsim("compare", str(flown), "finer", "--no-report", "--out", "both")
        assert code == 0
        compared = json.loads((tmp_path / "both" / "compare.json").read_text())
        assert [batch["name"] for batch in compared["batches"]] == ["whole", "finer"]
        assert "camera.noise_px" in [setting["key"] for setting in compared["settings"]]
        assert "5 common seeds" in out

    def test_what_no_longer_describes_it_is_removed(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        """A report of six flights and what a killed process was drawing, but nothing of somebody else's."""
        copy = copied(flown, tmp_path / "b", "summary.json")
        mine = {"notes.png", ".notes.png.part", "x.pdf"}
        drawing = (".report.html.part", ".report.md.part", ".rates.pdf.part")
        for name in ("report.html", "report.md", "rates.png", "rates.pdf", *drawing, *mine):
            (copy / name).write_text("")
        (copy / "rates").mkdir()
        code, _, err = landsim(
            "batch", "landing", *SETTINGS, "-n", "7", "--resume", "--no-report", "--workers", "1", "--out", "b"
        )
        told = "removed report.html, report.md and 2 figures, of 6 flights: the batch goes on to 7"
        assert (code, err.splitlines()[0]) == (0, f"landsim: b: {told}; landsim plot draws them again")
        assert err.splitlines()[-1].startswith("landsim: 1 flight in ")
        own = {".lock", "batch.json", "flights.parquet", "scenario.toml", "summary.json"}
        assert {path.name for path in copy.iterdir()} == own | mine | {"rates"}
        assert json.loads((copy / "summary.json").read_text())["batch"]["n"] == 7
        for name in ("report.html", "report.md"):
            (copy / name).write_text("")
        code, _, err = landsim("batch", "landing", *SETTINGS, "--resume", "--no-report", "--out", "b")
        assert (code, err, (copy / "report.html").exists(), (copy / "report.md").exists()) == (0, "", True, True)

    def test_tables_that_were_written_over_are_refused(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        copy = copied(flown, tmp_path / "b")
        whole = table(flown)
        at = whole.column_names.index("seed")
        pq.write_table(whole.set_column(at, "seed", pa.array([0, 1, 2, 3, 4, 9])), copy / "flights.parquet")
        resumed = ("batch", "landing", *SETTINGS, "--resume", "--out", "b")
        for arguments in (("compare", str(flown), "b"), ("plot", "b"), ("replay", "b", "0"), resumed):
            code, out, err = landsim(*arguments)
            assert (code, out, len(err.splitlines())) == (2, "", 1)
            assert "b/flights.parquet: flight 5 has the seed 9; it must be 5, the batch's first plus the index" in err

    def test_flights_that_are_missing_are_told(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        copy = copied(flown, tmp_path / "b")
        stored = json.loads((copy / "batch.json").read_text())
        (copy / "batch.json").write_text(json.dumps(stored | {"n": 9}))
        code, out, err = landsim("compare", str(flown), "b", "--no-report")
        told = "landsim: b: 6 of its 9 flights are there; landsim batch --resume flies the others\n"
        assert (code, err, "6 common seeds" in out) == (0, told, True)
        for arguments, what in (
            (("compare", "b", "b"), "b: is named twice; a batch is compared with others, not with itself"),
            (("compare", "b", "./b/../b"), "b/../b: is named twice"),
            (("compare", "b"), "a comparison needs two batches or more, not 1"),
            (("merge", "b"), "b: is a whole batch, not a shard of one: there is nothing to merge"),
            (("merge", "b", "b"), "b: is named twice; name each shard's folder once"),
        ):
            code, out, err = landsim(*arguments)
            assert (code, out, len(err.splitlines()), what in err) == (2, "", 1, True), err

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_an_interrupt_keeps_what_was_flown(
        self, number: signal.Signals, landsim: Run, flown: Path, tmp_path: Path
    ) -> None:
        arguments = ("landing", *SETTINGS, "--workers", "2", "--out", "b")
        batch = begin(*arguments, "-n", "400", "--chunk", "2", cwd=tmp_path)
        when_chunks(tmp_path / "b", 2, batch)
        os.killpg(batch.pid, number) if number == signal.SIGINT else batch.send_signal(number)
        out, err = batch.communicate(timeout=60)
        assert (batch.returncode, out) == (130, "")
        *_, line = err.splitlines()  # after lines of progress, where the machine is slow
        assert line.startswith("landsim: interrupted; what was flown is kept; to go on: landsim batch landing --set")
        assert line.endswith("--workers 2 --resume --out b")
        assert not list((tmp_path / "b").rglob("*.partial"))
        assert 4 <= kept(tmp_path / "b") < 400

    def test_killed_at_a_random_moment_and_resumed_it_is_the_same(
        self, landsim: Run, flown: Path, tmp_path: Path
    ) -> None:
        arguments = ("landing", *SETTINGS, "-n", "6", "--chunk", "1", "--out", "b", "--no-report")
        batch = begin(*arguments, "--workers", "2", cwd=tmp_path)
        when_chunks(tmp_path / "b", 1, batch)
        os.killpg(batch.pid, signal.SIGKILL)
        batch.communicate(timeout=60)
        assert 1 <= kept(tmp_path / "b") <= 6
        code, out, _ = landsim("batch", *arguments, "--workers", "1", "--resume")
        assert code == 0, out
        same(tmp_path / "b", flown)

    @pytest.mark.skipif(sys.platform == "win32", reason="limits the size of files")
    def test_a_disk_that_is_full_is_told_in_a_line(self, flown: Path, tmp_path: Path) -> None:
        """A file may be as large as one chunk of one flight, but not as one of all: as if the disk were full."""
        most = (flown / "flights.parquet").stat().st_size - 2000
        code = (
            f"import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, resource.RLIM_INFINITY));"
            "from landsim.cli import main; main(sys.argv[1:])"
        )
        common = ["batch", "landing", *SETTINGS, "--workers", "1", "--no-report", "--out", "b"]
        done = subprocess.run(
            [sys.executable, "-c", code, *common, "-n", "6", "--chunk", "1"],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        (line,) = [line for line in done.stderr.splitlines() if " flights in " not in line]
        assert (done.returncode, done.stdout) == (2, "")
        assert "flights.parquet: cannot be written: File too large; what was flown is kept; to go on: " in line
        assert kept(tmp_path / "b") == 6
        resumed = begin(*common[1:], "--resume", cwd=tmp_path)
        _, err = resumed.communicate(timeout=120)
        assert resumed.returncode == 0, err
        same(tmp_path / "b", flown)


class TestReplay:
    def test_identical(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        code, out, _ = landsim("replay", str(flown), "4", "--no-plots", "--out", "again")
        assert code == 0
        assert "flight 4 of" in out
        assert "identical in every bit" in out
        assert read_run(tmp_path / "again").metrics["seed"] == 4

    def test_not_identical(self, landsim: Run, flown: Path, tmp_path: Path) -> None:
        rows = table(flown)
        at = rows.column_names.index("start_cross_m")
        changed = rows.set_column(at, "start_cross_m", [[0.0] * 6])
        (tmp_path / "other").mkdir()
        for name in ("batch.json", "scenario.toml"):
            (tmp_path / "other" / name).write_bytes((flown / name).read_bytes())
        pq.write_table(changed, tmp_path / "other" / "flights.parquet")
        code, out, _ = landsim("replay", "other", "4", "--no-plots")
        assert code == 1
        assert "NOT identical: start_cross_m was 0.0 and is " in out
        assert "with the same versions" in out


REFUSED: list[tuple[list[str], str]] = [
    (["batch", "landing"], "-n N is missing"),
    (["batch", "landing", "-n", "0"], "must be a whole number, 1 or more, not 0"),
    (["batch", "landing", "-n", "1" + 30 * "0"], "n: must be 1 to"),
    (["batch", "landing", "-n", "-3"], "must be a whole number, 1 or more, not -3"),
    (["batch", "landing", "-n", "2.5"], "must be a whole number"),
    (["batch", "landing", "-n", "5", "--seed", "x"], "must be a whole number"),
    (["batch", "landing", "-n", "5", "--seed", str(2**63)], "seed: must leave room"),
    (["batch", "landing", "-n", "5", "--workers", "0"], "must be a whole number, 1 or more, not 0"),
    (["batch", "landing", "-n", "5", "--workers", "1025"], "--workers must be at most 1024, not 1025"),
    (["batch", "landing", "-n", "5", "--shard", "4/3"], "shard: must be i/n"),
    (["batch", "landing", "-n", "5", "--engine", "ray"], "ray"),
    (["batch", "landing", "-n", "5", "--scheduler", "tcp://127.0.0.1:1"], "needs --engine dask"),
    (["batch", "landing", "-n", "5", "--keep", "some"], "some"),
    (["batch", "landing", "-n", "5", "--time-limit", "0"], "time limit: must be above 0"),
    (["batch", "landing", "-n", "5", "--time-limit", "nan"], "time limit: must be above 0"),
    (["batch", "landing", "-n", "5", "--chunk", "0"], "must be a whole number, 1 or more, not 0"),
    (["batch", "landing", "-n", "5", "--chunk", "100001"], "chunk: must be 1 to"),
    (["batch", "landing", "-n", "5", "--resume"], "--resume needs --out"),
    (["batch", "landing", "-n", "5", "--resume", "--out", "new"], "batch.json is missing"),
    (["batch", "landing", "-n", "5", "--out", "full"], "is not empty"),
    (["batch", "landing", "-n", "5", "--set", "camera.nois_px=1"], "did you mean"),
    (["batch", "paper-fig3", "-n", "5"], "kind: a study is not flown in a batch"),
    (["batch", "nosuch", "-n", "5"], "nosuch"),
    (["merge"], "Missing argument"),
    (["merge", "full"], "is not a batch"),
    (["merge", "nosuch"], "is not a batch"),
    (["replay", "full", "0"], "is not a batch"),
    (["replay", "full", "x"], "must be a whole number"),
    (["compare", "full", "full"], "is named twice"),
    (["compare", "full", "nosuch"], "is not a batch"),
]


@pytest.mark.parametrize(("arguments", "told"), REFUSED, ids=[" ".join(arguments)[:60] for arguments, _ in REFUSED])
def test_bad_input_is_one_line_and_nothing_written(
    arguments: list[str], told: str, landsim: Run, tmp_path: Path
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    code, out, err = landsim(*arguments)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert told in err
    assert {path.name for path in tmp_path.rglob("*")} == {"full", "thesis.tex"}


def test_a_dispersion_that_makes_no_scenario_is_refused(landsim: Run, tmp_path: Path) -> None:
    draws = 'dispersions.draw=[{key="camera.noise_px", distribution="normal", mean=0.5, sigma=5.0}]'
    code, out, err = landsim("batch", "landing", "-n", "50", "--set", draws)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "normal draws -29.5 too, 6 sigma out, but camera.noise_px must be at least 0; use" in err
    assert landsim("check", "landing", "--set", draws) == (2, "", err)
    assert list(tmp_path.iterdir()) == []


def test_a_resumed_batch_is_the_same_batch(landsim: Run, flown: Path) -> None:
    before = {path: path.read_bytes() for path in flown.iterdir()}
    for changed, told in (
        (["--set", "runway.width_m=40.0"], "another scenario: runway.width_m is 30.0 there and 40.0 here"),
        (["--seed", "1"], "another seed: 0 there and 1 here"),
        (["-n", "5"], "holds a batch of 6 flights, which is more than 5"),
        (["--keep", "all"], "another keep: none there and all here"),
        (["--time-limit", "5"], "another time_limit_s: 60.0 there and 5.0 here"),
    ):
        code, out, err = landsim("batch", "landing", *SETTINGS, "--resume", "--out", str(flown), *changed)
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert told in err
    code, _, err = landsim("batch", "landing", *SETTINGS, "-n", "6", "--out", str(flown))
    assert (code, "--resume goes on with it" in err) == (2, True)
    assert {path: path.read_bytes() for path in flown.iterdir()} == before


class TestRate:
    def test_it_fits_a_narrow_terminal(self, monkeypatch: pytest.MonkeyPatch) -> None:
        class Terminal(io.StringIO):
            def isatty(self) -> bool:
                return True

        for columns in (40, 100):
            screen, now = Terminal(), 0.0
            monkeypatch.setattr(sys, "stderr", screen)
            monkeypatch.setenv("COLUMNS", str(columns))
            monkeypatch.setenv("TERM", "xterm")
            monkeypatch.setenv("NO_COLOR", "1")
            with flight_progress("dispersed, seed 0", FlightRate(10000, 9000, lambda: now)) as count:  # noqa: B023
                for _ in range(3):
                    now += 0.07
                    count(False)
                time.sleep(0.2)  # it is drawn ten times a second
            lines = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue()).replace("\r", "\n").split("\n")
            shown = [line.rstrip() for line in lines if " of 10000" in line or "/10000" in line]
            assert shown
            assert max(map(len, shown)) <= columns
            assert "0.0 % in" in shown[-1]
            assert max(line.count("0:01:10") for line in lines) == 1

    def test_the_start_does_not_count(self) -> None:
        times = iter([100.0, 100.5, 101.0, 102.0])
        rate = FlightRate(20, 4, lambda: next(times))
        assert (rate.per_second, rate.text()) == (None, "starting")
        for success in (True, True, False, True):
            rate.add(success=success)
        assert rate.per_second == 1.5  # three more in two seconds
        assert rate.text() == "1.5 flights/s, 0:00:08 left, 75.0 % in the box"  # twelve to go
        assert (rate.done, rate.flown) == (8, 4)


def test_a_line_now_and_then_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    with flight_progress("landing", FlightRate(100, 0, lambda: now)) as count:
        for _ in range(30):
            now += 1.0
            count(True)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "landsim: landing: 10 of 100 flights, 1.0 flights/s, 0:01:30 left, 100.0 % in the box",
        "landsim: landing: 20 of 100 flights, 1.0 flights/s, 0:01:20 left, 100.0 % in the box",
        "landsim: landing: 30 of 100 flights, 1.0 flights/s, 0:01:10 left, 100.0 % in the box",
    ]
