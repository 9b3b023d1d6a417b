"""A batch's folder: what is kept of an interrupted one, and which are refused."""

import errno
import json
import math
import os
from pathlib import Path
from typing import Any

import batches
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from batches import drawn, equal, fly_into, identity, same, short, table

from landsim.batch.chunks import BatchStopped, Chunks
from landsim.batch.folder import check_new, load_batch, locked, open_batch
from landsim.batch.gather import GROUP, gather
from landsim.batch.identity import MOST_FLIGHTS, Shard, differing_key, digest_of_files, identify, read_identity
from landsim.batch.job import Job
from landsim.batch.replay import find_flight, first_difference
from landsim.batch.row import Row
from landsim.batch.rows import save_rows
from landsim.batch.verify import check_flights
from landsim.config import Scenario
from landsim.dispersion import keys_of
from landsim.errors import InputError, RunFolderError

FINISHED = {".lock", "batch.json", "flights.parquet", "scenario.toml"}


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def indices(path: Path) -> list[int]:
    found: list[int] = pq.read_table(path)["index"].to_pylist()
    return found


def made_up(*asked: Any) -> Row:
    """A row that was not flown, with an outcome that there is."""
    return batches.made_up(*asked) | {"outcome": "landed"}


def never(*_: Any) -> Row:
    raise AssertionError


class Interrupt:
    """The flights, until one of them interrupts the batch as Ctrl-C does."""

    def __init__(self, after: int) -> None:
        self.after = after

    def __call__(self, row: Row) -> None:
        self.after -= 1
        if self.after == 0:
            raise KeyboardInterrupt


def interrupted(folder: Path, scenario: Scenario, n: int, after: int, **how: Any) -> None:
    with pytest.raises(KeyboardInterrupt):
        fly_into(folder, scenario, identity(scenario, n, **how), fly=made_up, progress=Interrupt(after))


class TestChunks:
    def test_each_is_written_when_it_is_complete(self, tmp_path: Path) -> None:
        chunks = Chunks(tmp_path / "chunks", range(10), 4, np.zeros(10, dtype=bool))
        for index in (9, 1, 0, 3, 4, 5, 7):
            chunks.add(made_up(short(), None, Job(index, index)))
        assert chunks.files() == []
        chunks.add(made_up(short(), None, Job(8, 8)))
        chunks.add(made_up(short(), None, Job(2, 2)))
        assert [(path.name, indices(path)) for path in chunks.files()] == [
            ("00000000-00000003.parquet", [0, 1, 2, 3]),
            ("00000008-00000009.parquet", [8, 9]),
        ]
        assert list(chunks.missing()) == [6]
        chunks.flush()
        assert indices(tmp_path / "chunks" / "00000004-00000007.parquet") == [4, 5, 7]

    def test_of_a_shard(self, tmp_path: Path) -> None:
        chunks = Chunks(tmp_path / "chunks", Shard(2, 3).indices(12), 2, np.zeros(4, dtype=bool))
        for index in (1, 4, 7):
            chunks.add(made_up(short(), None, Job(index, index)))
        assert [(path.name, indices(path)) for path in chunks.files()] == [("00000001-00000004.parquet", [1, 4])]
        assert list(chunks.missing()) == [10]

    def test_another_s_flight_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "chunks").mkdir()
        save_rows(tmp_path / "chunks" / "x.parquet", [made_up(short(), None, Job(10, 10))])
        with pytest.raises(RunFolderError, match="holds flight 10, which does not belong"):
            Chunks(tmp_path / "chunks", range(10), 4, np.zeros(10, dtype=bool))


class TestFolder:
    def test_a_finished_batch(self, tmp_path: Path) -> None:
        scenario = drawn()
        wanted = identity(scenario, 9, seed=3)
        fly_into(tmp_path / "b", scenario, wanted, fly=made_up)
        assert names(tmp_path / "b") == FINISHED
        there = table(tmp_path / "b").to_pylist()
        assert [row["index"] for row in there] == list(range(9))
        assert there[4]["draw.camera.noise_px"] != there[5]["draw.camera.noise_px"]
        loaded, found = load_batch(tmp_path / "b")
        assert (found, loaded.name, loaded.dispersions) == (wanted, "landing", scenario.dispersions)
        assert json.loads((tmp_path / "b" / "batch.json").read_text())["shard"] == "1/1"
        assert "landsim batch scenario.toml -n 9 --seed 3" in (tmp_path / "b" / "scenario.toml").read_text()

    @pytest.mark.parametrize("after", [1, 5, 6, 11])
    def test_interrupted_and_resumed_it_is_the_same(self, after: int, tmp_path: Path) -> None:
        scenario = drawn("latin-hypercube")
        wanted = identity(scenario, 11)
        fly_into(tmp_path / "whole", scenario, wanted, fly=made_up)
        interrupted(tmp_path / "b", scenario, 11, after)
        kept = [index for path in (tmp_path / "b" / "chunks").iterdir() for index in indices(path)]
        assert len(kept) == after
        flown: list[Row] = []
        fly_into(tmp_path / "b", scenario, wanted, resume=True, fly=made_up, progress=flown.append)
        assert sorted(kept + [row["index"] for row in flown]) == list(range(11))
        assert names(tmp_path / "b") == FINISHED
        same(tmp_path / "b", tmp_path / "whole")

    @pytest.mark.parametrize("sampling", ["random", "sobol"])
    @pytest.mark.parametrize("first", [5, 9])
    def test_it_may_grow_finished_or_not(self, sampling: str, first: int, tmp_path: Path) -> None:
        scenario = drawn(sampling)
        fly_into(tmp_path / "whole", scenario, identity(scenario, 14), fly=made_up)
        fly_into(tmp_path / "b", scenario, identity(scenario, first), fly=made_up)
        fly_into(tmp_path / "b", scenario, identity(scenario, 14), resume=True, fly=made_up)
        interrupted(tmp_path / "c", scenario, first, 3)
        interrupted_again = identity(scenario, 12)
        with pytest.raises(KeyboardInterrupt):
            fly_into(tmp_path / "c", scenario, interrupted_again, resume=True, fly=made_up, progress=Interrupt(4))
        fly_into(tmp_path / "c", scenario, identity(scenario, 14), resume=True, fly=made_up)
        for name in "bc":
            same(tmp_path / name, tmp_path / "whole")
            assert read_identity(tmp_path / name).n == 14

    def test_a_finished_one_resumed_flies_nothing(self, tmp_path: Path) -> None:
        scenario = short()
        fly_into(tmp_path / "b", scenario, identity(scenario, 5), fly=made_up)
        fly_into(tmp_path / "b", scenario, identity(scenario, 5), resume=True, fly=never)
        assert indices(tmp_path / "b" / "flights.parquet") == list(range(5))

    def test_what_a_killed_one_leaves_is_ignored(self, tmp_path: Path) -> None:
        """Half-written files; and, if it was killed while it tidied up, chunks beside the table that they are in."""
        scenario = short()
        interrupted(tmp_path / "b", scenario, 8, 6)
        half = tmp_path / "b" / "chunks" / ".00000004-00000007.parquet.123.partial"
        half.write_bytes(b"PAR1")
        (tmp_path / "b" / ".batch.json.123.partial").write_text("{")
        chunk = sorted((tmp_path / "b" / "chunks").glob("*.parquet"))[0]
        copy = chunk.read_bytes()
        fly_into(tmp_path / "b", scenario, identity(scenario, 8), resume=True, fly=made_up)
        assert names(tmp_path / "b") == FINISHED
        (tmp_path / "b" / "chunks").mkdir()
        chunk.write_bytes(copy)
        fly_into(tmp_path / "b", scenario, identity(scenario, 8), resume=True, fly=made_up)
        assert names(tmp_path / "b") == FINISHED
        assert indices(tmp_path / "b" / "flights.parquet") == list(range(8))

    @pytest.mark.parametrize("damage", ["a bit", "its end", "a name", "all of it"])
    def test_a_damaged_chunk_is_flown_again(self, damage: str, tmp_path: Path) -> None:
        scenario = short()
        fly_into(tmp_path / "whole", scenario, identity(scenario, 9), fly=made_up)
        interrupted(tmp_path / "b", scenario, 9, 8)
        path = tmp_path / "b" / "chunks" / "00000000-00000003.parquet"
        content = path.read_bytes()
        column = pq.read_metadata(path).row_group(0).column(20)
        last = (column.dictionary_page_offset or column.data_page_offset) + column.total_compressed_size - 1
        damaged = {
            "a bit": content[:last] + bytes([content[last] ^ 0x10]) + content[last + 1 :],
            "its end": content[:last],
            "a name": content.replace(b"outcome", b"outkome"),
            "all of it": b"",
        }
        path.write_bytes(damaged[damage])
        with open_batch(tmp_path / "b", scenario, identity(scenario, 9), resume=True) as batch:
            assert [aside.name for aside in batch.chunks.damaged] == [path.name + ".damaged"]
            assert set(range(4)) <= set(batch.chunks.missing())  # the ninth may have been flown before the interrupt
        fly_into(tmp_path / "b", scenario, identity(scenario, 9), resume=True, fly=made_up)
        same(tmp_path / "b", tmp_path / "whole")

    def test_a_full_disk_stops_it_and_it_goes_on(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        scenario = short()
        fly_into(tmp_path / "whole", scenario, identity(scenario, 12), fly=made_up)
        written, sync = 0, os.fsync

        def fsync(descriptor: int) -> None:
            nonlocal written
            written += os.fstat(descriptor).st_size
            if written > 120_000:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            sync(descriptor)

        with monkeypatch.context() as full:
            full.setattr(os, "fsync", fsync)
            with pytest.raises(BatchStopped, match=r"parquet: cannot be written: No space left on device"):
                fly_into(tmp_path / "b", scenario, identity(scenario, 12, chunk=2), fly=made_up)
        kept = [index for path in (tmp_path / "b" / "chunks").glob("*.parquet") for index in indices(path)]
        assert 0 < len(kept) < 12
        assert not list((tmp_path / "b").rglob("*.partial"))
        fly_into(tmp_path / "b", scenario, identity(scenario, 12, chunk=2), resume=True, fly=made_up)
        same(tmp_path / "b", tmp_path / "whole")

    def test_one_at_a_time(self, tmp_path: Path) -> None:
        scenario = short()
        with (
            open_batch(tmp_path / "b", scenario, identity(scenario, 2), resume=False),
            pytest.raises(RunFolderError, match="a batch is being written there"),
            locked(tmp_path / "b"),
        ):
            pass
        with locked(tmp_path / "b"):
            pass


class TestRefused:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        scenario = drawn("latin-hypercube")
        interrupted(tmp_path / "b", scenario, 9, 5)
        return tmp_path / "b"

    def told(self, folder: Path, scenario: Scenario, *, resume: bool = True, **how: Any) -> str:
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        wanted = identity(scenario, how.pop("n", 9), **how)
        with pytest.raises(RunFolderError) as caught:
            fly_into(folder, scenario, wanted, resume=resume, fly=made_up)
        assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
        return str(caught.value)

    def test_another_batch(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        scenario = drawn("latin-hypercube")
        other = short(**{"camera.line_noise": "endpoints", "runway.width_m": 40.0})
        assert "already holds a batch; --resume goes on with it" in self.told(folder, scenario, resume=False)
        assert "another scenario: runway.width_m is 30.0 there and 40.0 here" in self.told(folder, other)
        assert "another scenario: dispersions.sampling" in self.told(folder, drawn())
        assert "another seed: 0 there and 1 here" in self.told(folder, scenario, seed=1)
        assert "another shard: 1/1 there and 1/2 here" in self.told(folder, scenario, shard="1/2")
        assert "another keep: none there and all here" in self.told(folder, scenario, keep="all")
        assert "a batch of 9 flights, which is more than 8" in self.told(folder, scenario, n=8)
        assert "a Latin hypercube of 9 flights, which cannot grow to 10" in self.told(folder, scenario, n=10)
        renamed = scenario.model_copy(update={"name": "mine"})
        assert "holds a batch of landing, not of mine" in self.told(folder, renamed)
        stored = json.loads((folder / "batch.json").read_text())
        stored["versions"]["numpy"] = "1.0"
        (folder / "batch.json").write_text(json.dumps(stored))
        assert "with other versions: numpy 1.0 there and" in self.told(folder, scenario)

    def test_another_aircraft(self, tmp_path: Path, aircraft_copy: Any) -> None:
        copy = aircraft_copy("mine")
        scenario = short(**{"aircraft.name": str(copy)})
        interrupted(tmp_path / "b", scenario, 3, 2)
        with (copy / "pioneer.xml").open("a") as file:
            file.write("\n")
        assert "another aircraft: its files have changed" in self.told(tmp_path / "b", scenario, n=3)

    @pytest.mark.parametrize(
        ("content", "told"),
        [
            ("", "not JSON"),
            ("[]", "batch.json"),
            ('{"format": 1}', "scenario is missing"),
            (None, "batch.json is missing"),
        ],
    )
    def test_no_batch(self, content: str | None, told: str, tmp_path: Path) -> None:
        if content is not None:
            (tmp_path / "batch.json").write_text(content)
        with pytest.raises(RunFolderError, match=told):
            read_identity(tmp_path)

    def test_a_later_format_and_a_name_that_is_a_path(self, folder: Path) -> None:
        stored = json.loads((folder / "batch.json").read_text())
        for changed, told in (({"format": 99}, "has the format 99"), ({"scenario": "../x"}, "cannot be a name")):
            (folder / "batch.json").write_text(json.dumps(stored | changed))
            with pytest.raises(RunFolderError, match=told):
                read_identity(folder)

    def test_a_scenario_that_was_changed(self, folder: Path) -> None:
        text = (folder / "scenario.toml").read_text()
        (folder / "scenario.toml").write_text(text.replace("width_m = 30.0", "width_m = 31.0"))
        with pytest.raises(RunFolderError, match="is not the scenario that the batch was flown with"):
            load_batch(folder)
        told = self.told(folder, drawn("latin-hypercube"))
        assert "scenario.toml: is not the scenario that the batch was flown with: runway.width_m is 31.0 there" in told

    def test_places_where_no_batch_goes(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        (tmp_path / "full").mkdir()
        (tmp_path / "full" / "thesis.tex").write_text("")
        (tmp_path / "left").mkdir()
        (tmp_path / "left" / ".lock").write_text("")
        check_new(tmp_path / "left")
        check_new(tmp_path / "new")
        for name, told in (("file", "is a file"), ("full", "is not empty"), ("\0", "must be UTF-8 text")):
            with pytest.raises(RunFolderError, match=told):
                check_new(tmp_path / name)

    @pytest.mark.parametrize(
        ("changed", "told"),
        [
            ({"n": 0}, f"n: must be 1 to {MOST_FLIGHTS}, not 0"),
            ({"n": 10**30}, "n: must be 1 to"),
            ({"seed": 2**63 - 2}, "seed: must leave room below 2\\*\\*63 for 5 flights"),
            ({"time_limit_s": 0.0}, "time limit: must be above 0"),
            ({"time_limit_s": float("nan")}, "time limit: must be above 0"),
            ({"chunk": 0}, "chunk: must be 1 to"),
            ({"shard": Shard(6, 7)}, "shard: 6/7 has no flight in a batch of 5"),
        ],
    )
    def test_batches_that_cannot_be(self, changed: dict[str, Any], told: str) -> None:
        order: dict[str, Any] = {"n": 5, "seed": 0, "shard": Shard(), "keep": "none", "time_limit_s": 60.0, "chunk": 4}
        with pytest.raises(InputError, match=told):
            identify(short(), **(order | changed))

    def test_a_study_is_no_batch(self) -> None:
        from landsim.config import load_scenario

        with pytest.raises(InputError, match="kind: a study is not flown in a batch"):
            identify(load_scenario("paper-fig3"), 5, 0, Shard(), "none", 60.0, 4)

    @pytest.mark.parametrize("text", ["", "1", "0/3", "4/3", "1/0", "-1/3", "1/3/3", "a/b", "1 /3"])
    def test_shards_that_are_none(self, text: str) -> None:
        with pytest.raises(InputError, match="shard: must be i/n"):
            Shard.parse(text)


def test_shards_are_all_flights_once() -> None:
    parts = [index for number in (1, 2, 3, 4) for index in Shard.parse(f"{number}/4").indices(10)]
    assert sorted(parts) == list(range(10))


def test_the_first_key_that_differs() -> None:
    assert differing_key("a = 1\n[b]\nc = 2\n", "a = 1\n[b]\nc = 3\n") == "b.c is 2 there and 3 here"
    assert differing_key("a = 1", "a = 1\nb = [1, 2]") == "b is nothing there and [1, 2] here"


def test_a_digest_is_of_names_and_contents(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("1")
    first = digest_of_files(tmp_path)
    (tmp_path / "notes.txt").write_text("2")
    assert digest_of_files(tmp_path) == first
    (tmp_path / "a.xml").rename(tmp_path / "b.xml")
    assert digest_of_files(tmp_path) != first


class TestDoctored:
    """Tables that somebody has written over those of the batch."""

    CHANGES: tuple[tuple[str, list[Any] | pa.Array, str], ...] = (
        ("index", [0, 1, 2, 3, 3], "holds flight 3 2 times; each must be there once"),
        ("index", [0, 1, 2, 3, 9], "holds flight 9, which does not belong to the batch"),
        ("index", [0, 1, 2, 3, None], "one of them has no index"),
        ("seed", [7, 8, 9, 10, 99], "flight 4 has the seed 99; it must be 11, the batch's first plus the index"),
        ("seed", [7, 8, 9, 10, None], "flight 4 has no seed"),
        ("seed", ["7", "8", "9", "10", "11"], "column seed must be int64, not string"),
        ("outcome", [*4 * ["landed"], "flew"], 'flight 4 has the outcome "flew"; there are landed, crashed'),
        ("in_box", [1, 1, 1, 1, 1], "column in_box must be bool, not int64"),
        ("draw.camera.noise_px", [*4 * [0.5], None], "flight 4 has no draw.camera.noise_px"),
        ("draw.camera.noise_px", [*4 * [0.5], math.inf], "flight 4 has no number as draw.camera.noise_px"),
        ("sigma_cross_m", 5 * [1.0], "column sigma_cross_m must be list<item: double>, not double"),
    )

    def doctor(self, path: Path, name: str, values: Any) -> None:
        whole = pq.read_table(path)
        pq.write_table(whole.set_column(whole.column_names.index(name), name, pa.array(values)), path)

    def test_are_refused_by_whoever_reads_them(self, tmp_path: Path) -> None:
        scenario = drawn()
        wanted = identity(scenario, 5, seed=7)
        fly_into(tmp_path / "b", scenario, wanted, fly=made_up)
        path = tmp_path / "b" / "flights.parquet"
        content = path.read_bytes()
        assert check_flights(path, wanted, keys_of(scenario)) == 5
        for name, values, told in self.CHANGES:
            path.write_bytes(content)
            self.doctor(path, name, values)
            with pytest.raises(RunFolderError) as caught:
                check_flights(path, wanted, keys_of(scenario))
            assert told in str(caught.value)
            assert str(caught.value).startswith(str(path))
            with pytest.raises(RunFolderError):
                find_flight(tmp_path / "b", 2)
            if not name.startswith("draw."):
                with pytest.raises(RunFolderError):
                    fly_into(tmp_path / "b", scenario, wanted, resume=True, fly=never)
        pq.write_table(pq.read_table(path).drop_columns(["draw.camera.noise_px"]), path)
        with pytest.raises(RunFolderError, match=r"column draw\.camera\.noise_px is missing"):
            find_flight(tmp_path / "b", 2)

    def test_a_chunk_is_flown_again(self, tmp_path: Path) -> None:
        scenario = short()
        interrupted(tmp_path / "b", scenario, 9, 8)
        path = tmp_path / "b" / "chunks" / "00000000-00000003.parquet"
        held = pq.read_table(path)["index"].to_pylist()  # three or four, by the order in which the workers ended
        self.doctor(path, "index", [*held[:-1], held[-2]])
        with open_batch(tmp_path / "b", scenario, identity(scenario, 9), resume=True) as batch:
            assert set(range(4)) <= set(batch.chunks.missing())


class TestGather:
    def save(self, path: Path, numbers: list[int]) -> Path:
        save_rows(path, [made_up(short(), None, Job(i, i)) for i in numbers])
        return path

    def test_in_order_from_anywhere(self, tmp_path: Path) -> None:
        n = GROUP + 31
        order = np.random.default_rng(1).permutation(n).tolist()
        sources = [self.save(tmp_path / f"{i}", order[i::3]) for i in range(3)]
        gather(sources, tmp_path / "all", range(n))
        one = self.save(tmp_path / "one", list(range(n)))
        equal(tmp_path / "all", one)
        gather([tmp_path / "all"], tmp_path / "all", range(n))
        equal(tmp_path / "all", one)

    def test_what_is_not_right_is_told_and_nothing_written(self, tmp_path: Path) -> None:
        one, other = self.save(tmp_path / "one", [0, 1, 2]), self.save(tmp_path / "other", [2, 3])
        for sources, wanted, told in (
            ([one, other], range(4), "flight 2 is in .*one and in .*other"),
            ([one, one], range(3), "flight 0 is in .*one twice"),
            ([one], range(9), "6 of 9 flights are missing: 3, 4, 5, 6, 7 and 1 more"),
            ([one], range(2), "one: holds flight 2, which does not belong"),
            ([tmp_path / "none"], range(2), "none: cannot be read: No such file"),
        ):
            with pytest.raises(RunFolderError, match=told):
                gather(sources, tmp_path / "all", wanted)
        (tmp_path / "text").write_text("text")
        with pytest.raises(RunFolderError, match="not a Parquet file"):
            gather([tmp_path / "text"], tmp_path / "all", range(2))
        save_rows(tmp_path / "drawn", [made_up(short(), None, Job(3, 3, {"camera.noise_px": 0.5}))])
        with pytest.raises(RunFolderError, match="has not the columns of"):
            gather([one, tmp_path / "drawn"], tmp_path / "all", range(4))
        assert not (tmp_path / "all").exists()


class TestFind:
    def test_in_a_finished_batch_and_in_another(self, tmp_path: Path) -> None:
        scenario = drawn()
        fly_into(tmp_path / "done", scenario, identity(scenario, 9, seed=4), fly=made_up)
        interrupted(tmp_path / "half", scenario, 9, 5, seed=4)
        for name in ("done", "half"):
            there = list((tmp_path / name).rglob("*.parquet"))
            index = indices(there[-1])[0]
            found = find_flight(tmp_path / name, index)
            expected = made_up(scenario, None, found.job)
            assert found.job.draws["camera.noise_px"] == found.row["draw.camera.noise_px"]
            assert (found.job.seed, first_difference(found.row, expected)) == (4 + index, None)
            assert first_difference(found.row, expected | {"seed": 0, "x_m": 0.0}) == "seed"

    def test_what_there_is_not(self, tmp_path: Path) -> None:
        scenario = short()
        interrupted(tmp_path / "b", scenario, 9, 3)
        with pytest.raises(RunFolderError, match="holds a batch of 9 flights, 0 to 8, not 9"):
            find_flight(tmp_path / "b", 9)
        missing = set(range(9)) - {i for path in (tmp_path / "b" / "chunks").iterdir() for i in indices(path)}
        with pytest.raises(RunFolderError, match="has not been flown yet"):
            find_flight(tmp_path / "b", min(missing))


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (1.0, 1.0, True),
        (1.0, np.nextafter(1.0, 2.0), False),
        (0.0, -0.0, False),
        (float("nan"), float("nan"), True),
        (float("nan"), None, False),
        (1, 1.0, False),
        (np.array([1.0, np.nan]), np.array([1.0, np.nan]), True),
        (np.array([1.0, 0.0]), np.array([1.0, -0.0]), False),
        (np.array([1.0]), np.array([1.0, 2.0]), False),
        ("a", "b", False),
    ],
)
def test_the_same_to_a_bit(one: Any, other: Any, same: bool) -> None:
    expected = None if same else "x"
    assert first_difference({"x": one, "wall_time_s": 1.0}, {"x": other, "wall_time_s": 2.0}) == expected
