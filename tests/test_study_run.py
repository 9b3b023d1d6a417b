"""A study from its scenario to its folder: repeatable, whole or not there, drawn again, refused in one line."""

import json
import operator
import os
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from landsim import cli
from landsim.config import load_scenario
from landsim.errors import InputError, RunFolderError, ScenarioError
from landsim.runs import load_flight
from landsim.simulate import fly
from landsim.study.folder import load_envelopes, read_study, save_envelopes, write_study
from landsim.study.markdown import verdict_md
from landsim.study.model import OF_STAGE, Envelope
from landsim.study.plan import plan_of
from landsim.study.run import StudyResult, run_study
from landsim.study.tasks import Task, processes, run_tasks
from landsim.threads import THREAD_VARIABLES

REPOSITORY = Path(__file__).resolve().parents[1]
SMALL: dict[str, object] = {
    "start.along_m": -120.0,
    "start.height_m": 14.0,
    "camera.rate_hz": 6.0,
    "study.ranges_m": [120.0, 80.0],
    "study.draws": 100,
    "study.listed_draws": 200,
    "study.flights": 0,
}
"""Few frames and draws, and no flight."""
SMALL_LATE = SMALL | {"study.ranges_m": [20.0, 0.0], "study.roll_errors_deg": [0.0, 0.2]}
FLOWN: dict[str, object] = {
    "study.flights": 2,
    "study.readings": ["edge-points"],
    "study.ranges_m": [980.0, 900.0, 0.0],
    "study.draws": 100,
    "study.listed_draws": 200,
    "simulation.time_limit_s": 3.0,
}
"""Two flights of three seconds."""


def but_for_times(verdict: dict[str, Any]) -> dict[str, Any]:
    """A verdict without what a clock has measured."""

    def strip(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: strip(item) for key, item in value.items() if not key.endswith(("_us", "wall_time_s"))}
        return [strip(item) for item in value] if isinstance(value, list) else value

    kept: dict[str, Any] = strip(verdict)
    kept["claims"] = {key: claim for key, claim in kept["claims"].items() if key != "timing"}
    kept["claims"]["peers"] = {key: value for key, value in kept["claims"]["peers"].items() if key != "text"}
    return kept


@pytest.fixture(scope="module")
def early() -> StudyResult:
    return run_study(load_scenario("paper-fig3", SMALL), seed=4, workers=1)


@pytest.fixture(scope="module")
def late() -> StudyResult:
    return run_study(load_scenario("paper-fig4", SMALL_LATE), seed=4, workers=1)


class TestRun:
    def test_the_verdict_is_what_the_seed_makes_of_the_scenario(self, early: StudyResult) -> None:
        """Made again, by other processes, it is the same to the last digit: nothing in it is put in by hand."""
        again = run_study(load_scenario("paper-fig3", SMALL), seed=4, workers=2)
        assert but_for_times(again.verdict) == but_for_times(early.verdict)
        for one, other in zip(early.envelopes, again.envelopes, strict=True):
            assert one.percentiles.tobytes() == other.percentiles.tobytes()

    def test_it_is_plain_json(self, early: StudyResult) -> None:
        assert json.loads(json.dumps(early.verdict, allow_nan=False)) == early.verdict

    def test_every_quantity_reading_and_range_is_judged(self, early: StudyResult) -> None:
        entries = early.verdict["entries"]
        assert [(e["reading"], e["quantity"]) for e in entries] == [
            (reading, name) for reading in ("endpoints", "edge-points") for name in OF_STAGE["early"]
        ]
        for e in entries:
            assert [(row["range_m"], row["count"]) for row in e["listed"]] == [(120.0, 200), (80.0, 200)]
            assert e["precision"]["points"]["threshold"] >= 2
            assert e["source"] == "vision"
        assert {p["range_m"] for p in early.verdict["proportions"]} == {120.0, 80.0}
        assert "no flights" in early.verdict["paragraphs"]["fused"]

    def test_frames_are_where_the_aircraft_would_be(self, early: StudyResult) -> None:
        whole = early.envelopes[0]
        step = 40.0 * np.cos(np.radians(3.0)) / 6.0
        np.testing.assert_allclose(np.diff(whole.distance), -step, rtol=1e-9)
        assert whole.distance[0] == 120.0
        assert (whole.count == 100).all()

    def test_late_with_every_roll_error(self, late: StudyResult) -> None:
        assert [(e.reading, round(np.degrees(e.roll_error), 9)) for e in late.envelopes] == [
            ("endpoints", 0.0),
            ("endpoints", 0.2),
            ("edge-points", 0.0),
            ("edge-points", 0.2),
        ]
        cross = {
            e["roll_error_deg"]: e["listed"][-1]["p95"]
            for e in late.verdict["entries"]
            if (e["reading"], e["quantity"]) == ("edge-points", "cross")
        }
        (true, off) = (cross[key] for key in sorted(cross))
        # 0.2° at a camera height of 7.7 m: 0.129 m
        assert off > true + 0.08
        limits = late.verdict["roll_limits"]
        assert [(x["reading"], x["quantity"]) for x in limits] == [
            (reading, name) for reading in ("endpoints", "edge-points") for name in OF_STAGE["late"]
        ]
        assert "roll error" in late.verdict["paragraphs"]["roll"]

    @pytest.mark.slow
    def test_progress_ends_at_the_whole_and_another_seed_makes_another(self, late: StudyResult) -> None:
        told: list[tuple[float, float, str]] = []
        other = run_study(
            load_scenario("paper-fig4", SMALL_LATE | {"study.readings": ["endpoints"]}),
            seed=5,
            progress=lambda *at: told.append(at),
            workers=1,
        )
        assert told[0][0] == 0.0
        assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
        assert told[-1][0] == pytest.approx(told[-1][1])
        one, another = (result.verdict["entries"][0] for result in (late, other))
        assert (one["reading"], one["quantity"]) == (another["reading"], another["quantity"])
        assert one["listed"] != another["listed"]

    def test_flights_make_the_fused_errors(self) -> None:
        result = run_study(load_scenario("paper-flight", FLOWN | {"study.stage": "early"}), seed=7, workers=1)
        assert [row["seed"] for row in result.rows] == [7, 8]
        assert {e.source for e in result.envelopes} == {"vision", "fused"}
        flights = result.verdict["flights"]["edge-points"]
        assert (flights["first_seed"], flights["last_seed"], flights["outcomes"]) == (7, 8, {"timeout": 2})
        fused = [e for e in result.verdict["entries"] if (e["source"], e["quantity"]) == ("fused", "cross")]
        assert [row["count"] for row in fused[0]["listed"]] == [2, 2]
        # two flights have no 95th percentile, and no bound can be said to hold
        assert fused[0]["listed"][-1]["p95"] is None
        assert {e["holds"] for e in result.verdict["entries"]} == {None}
        assert "| too few flights |" in verdict_md(result.verdict)
        assert result.verdict["draws"] is None
        assert all(e["precision"] is None for e in result.verdict["entries"])

    def test_a_study_is_not_flown(self) -> None:
        with pytest.raises(ValueError, match="is not flown"):
            fly(load_scenario("paper-fig3"))

    def test_a_flight_is_not_studied(self) -> None:
        with pytest.raises(ValueError, match="is not studied"):
            run_study(load_scenario("landing"))


class TestRefused:
    @pytest.mark.parametrize(
        ("name", "overrides", "told"),
        [
            (
                "paper-fig3",
                {"study.ranges_m": [1001.0]},
                "study.ranges_m: must be within 1000.0 to .* (early), not 1001",
            ),
            ("paper-fig3", {"study.ranges_m": [30.0]}, "study.ranges_m: must be within .*, not 30"),
            ("paper-fig4", {"study.ranges_m": [60.0]}, "study.ranges_m: must be within .* (late), not 60"),
            ("paper-fig4", {"study.ranges_m": [-120.0]}, "study.ranges_m: must be within .* (late), not -120"),
            ("paper-fig3", {"study.pitch_early_deg": 40.0}, "study.stage: the straight approach shows .* early .* no"),
            (
                "paper-fig4",
                {"study.end_height_m": 70.0},
                "study.end_height_m: must be below start.height_m = 60, not 70",
            ),
        ],
    )
    def test_what_cannot_be_studied(self, name: str, overrides: dict[str, object], told: str) -> None:
        scenario = load_scenario(name, overrides)
        pattern = told.replace("(", r"\(").replace(")", r"\)")
        with pytest.raises(ScenarioError, match=pattern):
            plan_of(scenario)

    def test_a_seed_that_no_table_holds(self) -> None:
        with pytest.raises(InputError, match="seed: must leave room"):
            run_study(load_scenario("paper-fig3", SMALL), seed=2**63, workers=1)


class TestTasks:
    def test_in_order_whoever_did_it_and_a_failure_is_told(self) -> None:
        tasks = [Task(operator.mul, (i, i), 1.0, "squaring") for i in range(20)]
        failing = Task(operator.truediv, (1, 0), 1.0, "")
        done: list[Task] = []
        assert run_tasks(tasks) == [i * i for i in range(20)]
        with processes(2) as executor:
            assert run_tasks(tasks, executor, done.append) == [i * i for i in range(20)]
            with pytest.raises(ZeroDivisionError):
                run_tasks([failing, *tasks], executor)
        assert sorted(task.arguments for task in done) == [task.arguments for task in tasks]
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

    def test_alone_there_is_no_process(self) -> None:
        with processes(1) as executor:
            assert executor is None


@pytest.fixture
def folder(tmp_path: Path, early: StudyResult) -> Path:
    made = tmp_path / "study"
    made.mkdir()
    write_study(made, early.scenario, early.verdict, early.envelopes, early.listed, early.rows)
    return made


class TestFolder:
    def test_read_back(self, folder: Path, early: StudyResult) -> None:
        assert {path.name for path in folder.iterdir()} == {
            "scenario.toml",
            "verdict.json",
            "verdict.md",
            "envelopes.parquet",
        }
        study = read_study(folder)
        assert study.verdict == early.verdict
        assert (study.scenario.name, study.scenario.study) == ("paper-fig3", early.scenario.study)
        same(study.envelopes, early.envelopes)
        same(load_envelopes(folder / "envelopes.parquet", listed=True), early.listed)

    def test_gaps_and_whole_numbers_survive(self, tmp_path: Path, late: StudyResult) -> None:
        envelopes = tuple(replace(one, percentiles=one.percentiles.copy()) for one in late.envelopes)
        envelopes[0].percentiles[3:5] = np.nan
        envelopes[0].percentiles[6] = np.inf
        save_envelopes(tmp_path / "e.parquet", envelopes, ())
        same(load_envelopes(tmp_path / "e.parquet", listed=False), envelopes)
        assert load_envelopes(tmp_path / "e.parquet", listed=True) == ()

    def test_a_study_repeats_from_its_folder(self, folder: Path) -> None:
        scenario, seed = load_flight(str(folder), {"study.draws": 300})
        assert (scenario.name, seed) == ("paper-fig3", 4)
        assert scenario.study is not None
        assert (scenario.study.draws, scenario.study.ranges_m) == (300, (120.0, 80.0))
        head = (folder / "scenario.toml").read_text().splitlines()
        assert head[0].startswith("# paper-fig3, seed 4")
        assert "landsim run scenario.toml --seed 4" in head[1]

    @pytest.mark.parametrize("name", ["scenario.toml", "verdict.json", "envelopes.parquet"])
    def test_without_a_file_it_is_not_a_study(self, folder: Path, name: str) -> None:
        (folder / name).unlink()
        with pytest.raises(RunFolderError, match=name.replace(".", r"\.")):
            read_study(folder)

    @pytest.mark.parametrize(
        ("text", "told"),
        [("{", "not JSON"), ("{}", "scenario is missing"), ('{"scenario": "../up", "seed": 0}', "entries is missing")],
    )
    def test_another_verdict_is_refused(self, folder: Path, text: str, told: str) -> None:
        (folder / "verdict.json").write_text(text)
        for read in (read_study, lambda path: load_flight(str(path))):
            with pytest.raises(RunFolderError, match=f"is not a study: verdict.json: {told}"):
                read(folder)

    def test_other_tables_are_refused(self, folder: Path) -> None:
        path = folder / "envelopes.parquet"
        pq.write_table(pq.read_table(path).drop_columns(["sigma"]), path)
        with pytest.raises(RunFolderError, match="column sigma is missing"):
            read_study(folder)
        pq.write_table(pa.table({"a": [1]}), path)
        with pytest.raises(RunFolderError, match="column listed is missing"):
            read_study(folder)
        path.write_bytes(b"none")
        with pytest.raises(RunFolderError, match="not a Parquet file"):
            read_study(folder)


def same(some: tuple[Envelope, ...], others: tuple[Envelope, ...]) -> None:
    """To rounding: a table holds degrees."""
    assert len(some) == len(others)
    for one, other in zip(some, others, strict=True):
        assert (one.stage, one.reading, one.source, one.quantities) == (
            other.stage,
            other.reading,
            other.source,
            other.quantities,
        )
        assert one.roll_error == pytest.approx(other.roll_error, rel=1e-12)
        for name in ("distance", "time", "height", "count", "percentiles", "sigma", "single"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12)


class TestCommandLine:
    def landsim(self, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            cli.main(list(arguments))
        printed = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, printed.out, printed.err

    @pytest.fixture(autouse=True)
    def _apart(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        for variable in THREAD_VARIABLES:
            monkeypatch.setenv(variable, "1")

    @pytest.fixture
    def made(self, early: StudyResult, monkeypatch: pytest.MonkeyPatch) -> list[int]:
        """What is studied is at hand; the list gathers the seeds that were asked for."""
        seeds: list[int] = []

        def instead(scenario: Any, seed: int, progress: Any = None) -> StudyResult:
            assert scenario.kind == "study"
            seeds.append(seed)
            return early

        monkeypatch.setattr("landsim.study.run.run_study", instead)
        return seeds

    @pytest.mark.slow
    def test_everything_is_in_the_folder(
        self, capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        plain = {"scenario.toml", "verdict.json", "verdict.md", "envelopes.parquet"}
        code, out, err = self.landsim(capsys, "run", "paper-fig3", "--seed", "4", "--out", "there", "--no-plots")
        assert (code, err, made) == (0, "", [4])
        assert {path.name for path in (tmp_path / "there").iterdir()} == plain
        assert out.splitlines()[0] == "there"
        assert "early, vision, edge-points: 95 % of the errors stay below" in out
        assert all(f"  there/{name}" in out for name in plain)

        code, out, _ = self.landsim(capsys, "plot", "there")
        drawn = {Path(line.strip()).name for line in out.splitlines()}
        assert code == 0
        assert {"errors-early.png", "errors-early.pdf", "tilt.png", "tilt.pdf"} <= drawn
        assert {path.name for path in (tmp_path / "there").iterdir()} == plain | drawn

        monkeypatch.setattr("landsim.report.draw_study", lambda folder, *_: (folder / "a.png").write_bytes(b""))
        assert self.landsim(capsys, "run", "there")[0] == 0
        assert made == [4, 4]
        assert {path.name for path in (tmp_path / "runs" / "001-paper-fig3").iterdir()} == plain | {"a.png"}

    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            (("run", "paper-fig3", "--set", "study.ranges_m=[2000.0]"), "study.ranges_m: must be within"),
            (
                ("run", "paper-fig3", "--set", "study.readings=['endpoints', 'endpoints']"),
                "study.readings: must not repeat any, not ['endpoints', 'endpoints']",
            ),
            (
                ("run", "paper-fig4", "--set", "study.roll_errors_deg=[0.0, 0.2, 0.2]"),
                "study.roll_errors_deg: must not repeat any, not [0.0, 0.2, 0.2]",
            ),
            (("run", "paper-fig4", "--set", "study.roll_errors_deg=[0.0, 1e6]"), "study.roll_errors_deg"),
            (("run", "paper-fig3", "--set", "study.darws=1"), "did you mean study.draws?"),
            (("run", "paper-fig3", "--out", "done"), "done: already holds a run"),
            (("run", "paper-fig3", "--seed", "x"), "must be a whole number"),
            (("check", "paper-fig4", "--set", "study.ranges_m=[100.0]"), "study.ranges_m: must be within"),
            (("plot", "done"), "done: is not a study: scenario.toml is missing"),
            (("run", "done"), "done: is not a study: scenario.toml is missing"),
        ],
    )
    def test_bad_input_is_one_line(
        self, arguments: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[int]
    ) -> None:
        (tmp_path / "done").mkdir()
        (tmp_path / "done" / "verdict.json").write_text("{}")
        code, out, err = self.landsim(capsys, *arguments)
        assert (code, out, len(err.splitlines()), made) == (2, "", 1, [])
        assert told in err
        assert {path.name for path in tmp_path.rglob("*")} == {"done", "verdict.json"}

    def test_check_prints_the_study(self, capsys: pytest.CaptureFixture[str]) -> None:
        code, out, _ = self.landsim(capsys, "check", "paper-fig4", "--set", "study.flights=3")
        assert code == 0
        assert tomllib.loads(out)["study"]["flights"] == 3

    def test_an_interrupt_leaves_nothing(self, tmp_path: Path) -> None:
        """As by Ctrl-C, which the terminal sends to every process: exit code 130, a line, nothing left behind."""
        process = subprocess.Popen(
            [sys.executable, "-c", "from landsim.cli import main; main()", "run", "paper-fig3", "--out", "a/b"],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        for _ in range(600):
            if (tmp_path / "a").exists():
                break
            time.sleep(0.05)
        time.sleep(1.0)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out, err.strip()) == (130, b"", b"landsim: interrupted")
        assert list(tmp_path.iterdir()) == []
