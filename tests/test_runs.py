"""Run folders: numbered, written whole or not at all, read back as they were."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import FakeFlight, fake_flight

from landsim.config import load_scenario
from landsim.errors import RunFolderError, ScenarioError
from landsim.log import load_log
from landsim.plain import as_json
from landsim.runs import load_flight, new_run, read_run, write_run


def tree(folder: Path) -> list[str]:
    """Everything below a folder, hidden things included."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


class TestNumbers:
    def test_one_after_the_greatest(self, tmp_path: Path) -> None:
        names = []
        for name in ("landing", "other"):
            with new_run(name) as place:
                names.append(place.final.name)
        assert names == ["001-landing", "002-other"]
        for name in ("017-gone", "notes", "x-099"):
            (tmp_path / "runs" / name).mkdir()
        with new_run("landing") as place:
            assert place.final == Path("runs/018-landing")
        assert (tmp_path / "runs/018-landing").is_dir()

    def test_past_999(self, tmp_path: Path) -> None:
        (tmp_path / "runs/1000-landing").mkdir(parents=True)
        with new_run("landing") as place:
            assert place.final.name == "1001-landing"

    def test_nobody_gets_the_same(self, tmp_path: Path) -> None:
        def one(i: int) -> str:
            with new_run(f"s{i}") as place:
                return place.final.name.split("-")[0]

        with ThreadPoolExecutor(8) as pool:
            numbers = list(pool.map(one, range(40)))
        assert sorted(numbers) == [f"{i:03d}" for i in range(1, 41)]
        assert len(tree(tmp_path / "runs")) == 40


class TestWholeOrNot:
    def test_it_appears_with_everything_in_it(self, tmp_path: Path) -> None:
        with new_run("landing", Path("a/b/run")) as place:
            assert not (tmp_path / "a/b/run").exists()
            (place.temporary / "file").write_text("x")
        assert tree(tmp_path) == ["a", "a/b", "a/b/run", "a/b/run/file"]

    @pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
    @pytest.mark.parametrize("out", [None, Path("a/b/run")])
    def test_a_failure_leaves_nothing(self, failure: type[BaseException], out: Path | None, tmp_path: Path) -> None:
        def fail(place: Path) -> None:
            (place / "file").write_text("x")
            raise failure

        with pytest.raises(failure), new_run("landing", out) as place:
            fail(place.temporary)
        assert tree(tmp_path) == []

    def test_an_empty_folder_is_taken(self, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        with new_run("landing", Path("empty")) as place:
            (place.temporary / "file").write_text("x")
        assert tree(tmp_path) == ["empty", "empty/file"]

    def test_a_link_to_an_empty_folder_is_followed(self, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        (tmp_path / "link").symlink_to("empty")
        with new_run("landing", Path("link")) as place:
            (place.temporary / "file").write_text("x")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "empty/file").is_file()

    def test_a_folder_filled_meanwhile_is_kept(self, tmp_path: Path) -> None:
        with pytest.raises(RunFolderError, match="run: cannot be written"), new_run("landing", Path("run")) as place:
            (place.temporary / "file").write_text("x")
            (tmp_path / "run").mkdir()
            (tmp_path / "run/theirs").write_text("y")
        assert tree(tmp_path) == ["run", "run/theirs"]


class TestRefusedBeforehand:
    @pytest.mark.parametrize(
        ("out", "told"),
        [
            ("file", "file: is a file"),
            ("file/x/y", "file/x/y: cannot be written: .*Not a directory"),
            ("full", "full: is not empty"),
            ("run", "run: already holds a run"),
            ("empty", "empty: cannot be replaced"),
            ("loop", "loop: "),
            ("x" * 300, "x: cannot be written: .*too long"),
        ],
    )
    def test_folder(self, out: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "file").write_text("mine")
        for name in ("full/other", "run/metrics.json"):
            (tmp_path / name).parent.mkdir()
            (tmp_path / name).write_text("mine")
        (tmp_path / "empty").mkdir()
        (tmp_path / "loop").symlink_to("loop")
        before = tree(tmp_path)
        folder = Path(out)
        if out == "empty":
            monkeypatch.chdir("empty")
            folder = Path()
            told = "cannot be replaced"
        with pytest.raises(RunFolderError, match=told), new_run("landing", folder):
            pytest.fail("it was let in")
        assert tree(tmp_path) == before


class TestReadBack:
    def write(self, flight: FakeFlight) -> Path:
        folder = Path("run")
        folder.mkdir()
        write_run(folder, load_scenario("landing", {"runway.width_m": 45.0}), flight)
        return folder

    def test_as_written(self) -> None:
        flight = fake_flight()
        run = read_run(self.write(flight))
        assert (run.scenario.name, run.scenario.runway.width_m) == ("landing", 45.0)
        for name, column in flight.log.items():
            np.testing.assert_array_equal(run.log[name], column)
        assert run.metrics == as_json(flight.metrics)
        assert run.metrics["touchdown"]["heading_error_deg"] is None

    def test_metrics_are_plain_json(self) -> None:
        text = (self.write(fake_flight()) / "metrics.json").read_text()

        def refuse(constant: str) -> Any:
            raise AssertionError(constant)

        assert json.loads(text, parse_constant=refuse)["consistency"]["early"]["frames"] == 600

    @pytest.mark.parametrize("name", ["scenario.toml", "log.parquet", "metrics.json"])
    def test_without_a_file_it_is_not_a_run(self, name: str) -> None:
        folder = self.write(fake_flight())
        (folder / name).unlink()
        with pytest.raises(RunFolderError, match=f"run: is not a run: {name} is missing"):
            read_run(folder)

    @pytest.mark.parametrize("text", ["{", "[]", "{}", "3", '{"scenario": "x"}', "[" * 100000])
    def test_other_metrics_are_refused(self, text: str) -> None:
        folder = self.write(fake_flight())
        (folder / "metrics.json").write_text(text)
        with pytest.raises(RunFolderError, match=r"^run: is not a run: metrics\.json"):
            read_run(folder)

    @pytest.mark.parametrize(
        ("change", "told"),
        [
            ({"seed": -1}, "seed must be at least 0, not -1"),
            ({"seed": True}, "seed must be a whole number, not true"),
            ({"touchdown": {"x_m": 1.0}}, "touchdown.time_s is missing"),
            ({"scenario": "../up"}, 'scenario cannot be a name: "../up"'),
            ({"scenario": ""}, 'scenario cannot be a name: ""'),
        ],
    )
    def test_metrics_of_another_shape_are_refused(self, change: dict[str, Any], told: str) -> None:
        folder = self.write(fake_flight())
        metrics = json.loads((folder / "metrics.json").read_text()) | change
        (folder / "metrics.json").write_text(json.dumps(metrics))
        for read in (read_run, lambda path: load_flight(str(path))):
            with pytest.raises(RunFolderError) as caught:
                read(folder)
            assert str(caught.value) == f"run: is not a run: metrics.json: {told}"

    def test_a_log_without_a_column_is_refused(self) -> None:
        folder = self.write(fake_flight())
        pq.write_table(pq.read_table(folder / "log.parquet").drop_columns(["phase"]), folder / "log.parquet")
        with pytest.raises(RunFolderError, match=r"^run: is not a run: log\.parquet: column phase is missing$"):
            read_run(folder)

    def test_a_column_of_words_is_refused(self) -> None:
        folder = self.write(fake_flight())
        pq.write_table(pa.table({"time_s": ["a"]}), folder / "log.parquet")
        with pytest.raises(RunFolderError, match=r"^run: is not a run: log\.parquet: "):
            read_run(folder)

    def test_the_scenarios_first_lines_say_what_was_flown(self) -> None:
        text = (self.write(fake_flight("landing", 7)) / "scenario.toml").read_text()
        first, second, third = text.splitlines()[:3]
        assert first.startswith("# landing, seed 7")
        assert "landsim run DIR" in second
        assert "landsim run scenario.toml --seed 7" in second
        assert not third.startswith("#")


class TestReserved:
    def test_a_name_is_taken_from_the_start(self, tmp_path: Path) -> None:
        with new_run("landing", Path("a/run")) as place:
            with (
                pytest.raises(RunFolderError, match=r"a/run: is being written by another run"),
                new_run("landing", Path("a/run")),
            ):
                pytest.fail("it was let in")
            (place.temporary / "file").write_text("x")
        assert tree(tmp_path) == ["a", "a/run", "a/run/file"]

    def test_one_of_many_gets_it(self, tmp_path: Path) -> None:
        together = Barrier(8)

        def one(_: int) -> bool:
            together.wait()
            try:
                with new_run("landing", Path("run")) as place:
                    (place.temporary / "file").write_text("x")
            except RunFolderError:
                return False
            return True

        with ThreadPoolExecutor(8) as pool:
            assert sum(pool.map(one, range(8))) == 1
        assert tree(tmp_path) == ["run", "run/file"]

    def test_a_path_that_is_not_text_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(RunFolderError, match="must be UTF-8 text"), new_run("landing", Path("\udcff/a")):
            pytest.fail("it was let in")
        assert tree(tmp_path) == []


class TestLoadFlight:
    def run(self, folder: str) -> None:
        Path(folder).mkdir()
        write_run(Path(folder), load_scenario("landing", {"runway.width_m": 45.0}), fake_flight("mine", 7))

    def test_a_runs_folder_gives_name_seed_and_scenario(self) -> None:
        self.run("flown")
        scenario, seed = load_flight("flown", {"camera.rate_hz": 15.0})
        assert (scenario.name, seed, scenario.runway.width_m, scenario.camera.rate_hz) == ("mine", 7, 45.0, 15.0)

    def test_a_shipped_name_wins_over_a_folder(self) -> None:
        self.run("landing")
        assert load_flight("landing")[1] is None
        assert load_flight("./landing")[1] == 7

    def test_another_folder_is_refused(self) -> None:
        Path("empty").mkdir()
        with pytest.raises(RunFolderError, match=r"^empty: is not a run: scenario\.toml is missing$"):
            load_flight("empty")

    @pytest.mark.parametrize("name", ["", "nowhere", "x" * 300, "~nobody-of-that-name/x"])
    def test_what_is_not_there_is_no_scenario(self, name: str) -> None:
        with pytest.raises(ScenarioError):
            load_flight(name)

    def test_the_same_flight_again_bit_for_bit(self) -> None:
        from landsim.simulate import fly  # takes a second to import

        scenario = load_scenario("landing", {"simulation.time_limit_s": 3.0})
        folder = Path("flown")
        folder.mkdir()
        write_run(folder, scenario, fly(scenario, seed=5))
        again, seed = load_flight("flown")
        assert seed == 5
        flight = fly(again, seed)
        assert flight.metrics["scenario"] == "landing"
        first = load_log(folder / "log.parquet")
        assert all(first[name].tobytes() == column.tobytes() for name, column in flight.log.items())


def test_as_json() -> None:
    value = {"a": np.float64("nan"), 1: (np.int32(2), np.bool_(True)), "c": np.array([1.5, np.inf]), "d": None}
    assert as_json(value) == {"a": None, "1": [2, True], "c": [1.5, None], "d": None}
