"""Who flies a batch does not matter, and what becomes of flights that go wrong."""

import os
import random
import shutil
import signal
import threading
import time
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import batches
import pytest
from batches import drawn, fly_into, hang_without_python, identity, same, short, spoiled, table

from landsim.batch.chunks import BatchStopped
from landsim.batch.cluster import on_dask
from landsim.batch.deferred import uninterrupted
from landsim.batch.engine import Engine, on_processes, rows_of_jobs
from landsim.batch.folder import open_batch
from landsim.batch.job import Job, Keeper, KeepError, fly_job, jobs_of
from landsim.batch.merge import check_shards, merge
from landsim.batch.pool import Processes, workers
from landsim.batch.process import TookTooLong, WorkerDied, calls_of
from landsim.batch.row import Row
from landsim.errors import InputError, RunFolderError
from landsim.log import load_log
from landsim.runs import write_run


def made_up(*asked: Any) -> Row:
    """A row that was not flown, with an outcome that there is."""
    return batches.made_up(*asked) | {"outcome": "landed"}


def say(text: str, size: int) -> bytes:
    """Something large enough for a writer to be killed in the middle of it."""
    return text.encode() * size


def unpicklable() -> Any:
    return threading.Lock()


class TwoPartsError(Exception):
    """Cannot be made again from its arguments."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


def fail_in_two_parts() -> None:
    raise TwoPartsError(1, 2)


class TestUninterrupted:
    def test_a_signal_is_taken_at_the_end(self) -> None:
        before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
        steps = []
        with pytest.raises(KeyboardInterrupt), uninterrupted():
            signal.raise_signal(signal.SIGINT)
            steps.append("to its end")
        assert steps == ["to its end"]
        assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before

    def test_flights_are_handed_over_as_a_whole(self) -> None:
        """An interrupt in the middle of a future's methods would leave its lock taken."""
        futures: list[Future[Any]] = []

        class Interrupted(Executor):
            def submit(self, *_: Any, **__: Any) -> "Future[Any]":
                if not futures:
                    signal.raise_signal(signal.SIGINT)
                futures.append(Future())
                futures[-1].set_result({})
                return futures[-1]

        jobs = (Job(index, index) for index in range(9))
        with pytest.raises(KeyboardInterrupt):
            list(rows_of_jobs(jobs, lambda _: {}, lambda *_: {}, Engine(Interrupted(), 3)))
        assert len(futures) == 3


class TestProcesses:
    def test_results_failures_and_ends(self) -> None:
        with workers(2, time_limit=60.0) as pool:
            value = pool.submit(divmod, 7, 2)
            raised = pool.submit(divmod, 7, 0)
            ended = pool.submit(os._exit, 3)
            assert value.result(60) == (3, 1)
            with pytest.raises(ZeroDivisionError) as caught:
                raised.result(60)
            assert "divmod" not in str(caught.value)
            assert "Traceback" in caught.value.__notes__[0]
            with pytest.raises(WorkerDied, match="worker died: exit code 3"):
                ended.result(60)
            with pytest.raises(WorkerDied, match="worker died: signal 9"):
                pool.submit(signal.raise_signal, signal.SIGKILL).result(60)
            assert pool.submit(divmod, 9, 4).result(60) == (2, 1)

    def test_what_cannot_be_sent_is_a_failure_and_not_the_end(self) -> None:
        with workers(1) as pool:
            with pytest.raises(RuntimeError, match="TypeError: cannot pickle"):
                pool.submit(unpicklable).result(60)
            with pytest.raises(TypeError):
                pool.submit(fail_in_two_parts).result(60)
            assert pool.submit(abs, -1).result(60) == 1

    @pytest.mark.parametrize("hang", [time.sleep, hang_without_python])
    def test_a_limit_ends_what_hangs_and_says_where(self, hang: Any) -> None:
        with workers(1, time_limit=2.0) as pool:
            with pytest.raises(TookTooLong, match=r"took longer than the limit of 2 s of wall time") as caught:
                pool.submit(hang, *([3600.0] if hang is time.sleep else [])).result(60)
            where = caught.value.traceback  # None of a process that had to be killed before it could say
            if hang is hang_without_python and where is not None:
                assert where.endswith("in hang_without_python")
            assert pool.submit(abs, -1).result(60) == 1

    def test_the_limit_does_not_count_the_start(self) -> None:
        with workers(1, time_limit=0.5, initializer=time.sleep, initargs=(1.0,)) as pool:
            assert pool.submit(abs, -1).result(60) == 1

    def test_one_that_is_stopped_is_killed(self) -> None:
        with workers(1, time_limit=0.3) as pool:
            pool.submit(abs, -1).result(60)
            future = pool.submit(time.sleep, 0.2)
            os.kill(pool.pids()[0], signal.SIGSTOP)
            with pytest.raises(TookTooLong):
                future.result(60)

    @pytest.mark.slow
    def test_killed_at_any_moment_in_the_middle_of_a_result_too(self) -> None:
        """What is not lost is whole, and nothing waits for ever; the results take longer to write than to make."""
        rng = random.Random(4)
        lost = 0
        with workers(2) as pool:
            for _ in range(5):
                futures = [pool.submit(say, "x", 30_000_000) for _ in range(5)]
                futures[0].exception(60)
                for _ in range(3):
                    time.sleep(0.1 * rng.random())
                    for pid in pool.pids()[:1]:
                        os.kill(pid, signal.SIGKILL)
                for future in futures:
                    failure = future.exception(60)
                    assert isinstance(failure, WorkerDied | None)
                    assert failure is not None or len(future.result()) == 30_000_000
                    lost += failure is not None
        assert lost

    def test_processes_that_do_not_start_are_told(self) -> None:
        with workers(1, initializer=divmod, initargs=(1, 0)) as pool:
            with pytest.raises(BrokenExecutor, match="no process could be started: ZeroDivisionError"):
                pool.submit(abs, -1).result(60)
            with pytest.raises(BrokenExecutor):
                pool.submit(abs, -1)

    def test_nothing_is_taken_after_the_end(self) -> None:
        pool = Processes(1)
        pool.shutdown()
        with pytest.raises(RuntimeError, match="shut down"):
            pool.submit(abs, -1)

    def test_an_exception_ends_them_at_once(self) -> None:
        with pytest.raises(KeyboardInterrupt), workers(1) as pool:
            pool.submit(abs, -1).result(60)
            flying, waiting = pool.submit(time.sleep, 3600.0), pool.submit(abs, -1)
            while not flying.running():
                time.sleep(0.01)
            raise KeyboardInterrupt
        assert waiting.cancelled()
        with pytest.raises(CancelledError):
            flying.result(0)

    @pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads by /proc")
    def test_matrix_libraries_have_one_thread(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
            monkeypatch.setenv(variable, "3")
        with workers(1, initializer=__import__, initargs=("numpy.linalg",)) as pool:
            of_python = pool.submit(threading.active_count).result(60)
            assert len(pool.submit(os.listdir, "/proc/self/task").result(60)) == of_python
            assert pool.submit(os.getenv, "OPENBLAS_NUM_THREADS").result(60) == "1"
        assert os.environ["OPENBLAS_NUM_THREADS"] == "3"

    @pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="looks for processes in /proc")
    def test_they_die_with_their_parent(self, tmp_path: Path) -> None:
        """As of ``kill -9``: the parent here is a process of its own, in the middle of a call."""
        with workers(1) as pool, pytest.raises(WorkerDied):
            pool.submit(begin_and_die, str(tmp_path / "pid")).result(60)
        pid = int((tmp_path / "pid").read_text())
        for _ in range(600):
            if not is_alive(pid):
                return
            time.sleep(0.05)
        pytest.fail(f"process {pid} is still there")


def is_alive(pid: int) -> bool:
    """Whether a process is there, and not only to be waited for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def begin_and_die(path: str) -> None:
    """Begin a worker, note who it is, give it something to do, and be killed."""
    pool = Processes(1)
    pool.submit(abs, -1).result(60)
    Path(path).write_text(str(pool.pids()[0]))
    pool.submit(time.sleep, 3600.0)
    os.kill(os.getpid(), signal.SIGKILL)


def test_where_a_process_was_is_read_from_what_it_wrote() -> None:
    dump = (
        'Timeout (0:00:01)!\nThread 0x1 (most recent call first):\n  File "/a/reader.py", line 3 in read\n\n'
        'Thread 0x2 (most recent call first):\n  File "/a/b/deep.py", line 7 in inner\n'
        '  File "/a/outer.py", line 5 in outer\n  File "/l/batch/worker.py", line 9 in main\n'
        '  File "<string>", line 1 in <module>\n'
    )
    assert calls_of(dump) == "outer.py:5 in outer\ndeep.py:7 in inner"
    assert calls_of("") is None


class Counting(Executor):
    """Finishes nothing until it has been given so many."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Any]] = []
        self.most = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append((future, args))
        self.most = max(self.most, len(self.waiting))
        if len(self.waiting) == 3:
            for one, (job,) in reversed(self.waiting):
                one.set_result({"index": job.index})
            self.waiting.clear()
        return future


def lost(job: Job, reason: str, traceback: str | None) -> Row:
    return {"index": job.index, "reason": reason, "traceback": traceback}


class TestEngine:
    def test_jobs_are_taken_as_they_are_needed(self) -> None:
        executor, taken = Counting(), 0

        def jobs() -> Any:
            nonlocal taken
            for index in range(300):
                taken += 1
                yield Job(index, index)

        found = []
        for row in rows_of_jobs(jobs(), print, lost, Engine(executor, 3)):  # type: ignore[arg-type]
            found.append(row["index"])
            assert taken <= len(found) + 3
        assert sorted(found) == list(range(300))
        assert executor.most == 3

    def test_a_flight_that_raises_is_a_row(self) -> None:
        def fly(job: Job) -> Row:
            if job.index == 1:
                raise RuntimeError("wings\nfell off")
            return {"index": job.index, "reason": "", "traceback": None}

        with ThreadPoolExecutor(2) as pool:
            rows = list(rows_of_jobs([Job(i, i) for i in range(3)], fly, lost, Engine(pool, 2)))
        (wrong,) = [row for row in rows if row["reason"]]
        assert (wrong["index"], wrong["reason"]) == (1, "RuntimeError: wings\nfell off")
        assert "in fly: raise RuntimeError" in wrong["traceback"]

    @pytest.mark.parametrize(
        "failure", [KeepError("No space left on device"), BrokenExecutor("gone"), CancelledError()]
    )
    def test_what_no_flight_can_help_stops_the_batch(self, failure: Exception) -> None:
        def fly(job: Job) -> Row:
            raise failure

        with ThreadPoolExecutor(1) as pool, pytest.raises(BatchStopped):
            list(rows_of_jobs([Job(0, 0)], fly, lost, Engine(pool, 2)))

    def test_an_executor_that_will_not_answer_is_asked_about(self) -> None:
        def check() -> None:
            raise BatchStopped("nobody is left")

        class Silent(Executor):
            def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
                return Future()

        with pytest.raises(BatchStopped, match="nobody is left"):
            list(rows_of_jobs([Job(0, 0)], print, lost, Engine(Silent(), 2, check)))  # type: ignore[arg-type]

    def test_seeds_and_draws_are_by_index(self) -> None:
        scenario = drawn("latin-hypercube")
        whole = list(jobs_of(scenario, identity(scenario, 6, seed=40), range(6)))
        assert [job.seed for job in whole] == [40, 41, 42, 43, 44, 45]
        assert list(jobs_of(scenario, identity(scenario, 6, seed=40), [4, 1])) == [whole[4], whole[1]]
        assert len({job.draws["camera.noise_px"] for job in whole}) == 6


def test_whoever_flies_the_rows_are_the_same(tmp_path: Path) -> None:
    """One process, two, threads of a Dask cluster, and three shards merged; draws of a Sobol sequence."""
    scenario, n = drawn("sobol"), 7
    wanted = identity(scenario, n, seed=5)
    for count in (1, 2):
        with on_processes(count, 60.0) as engine:
            fly_into(tmp_path / f"by{count}", scenario, wanted, engine=engine)
            if count == 2:
                for shard in ("1/3", "2/3", "3/3"):
                    of = identity(scenario, n, seed=5, shard=shard)
                    fly_into(tmp_path / shard.replace("/", "-"), scenario, of, engine=engine)
    with on_dask(None, 2, 60.0, scenario.aircraft_config.folder, None) as engine:
        fly_into(tmp_path / "dask", scenario, wanted, engine=engine)
    shards = [tmp_path / name for name in ("2-3", "1-3", "3-3")]
    whole, merged = check_shards(shards)
    with open_batch(tmp_path / "merged", whole, merged, resume=False) as folder:
        merge(shards, folder)
    assert table(tmp_path / "by1")["index"].to_pylist() == list(range(n))
    assert len(set(table(tmp_path / "by1")["draw.camera.noise_px"].to_pylist())) == n
    assert set(table(tmp_path / "by1")["outcome"].to_pylist()) == {"timeout"}
    for other in ("by2", "dask", "merged"):
        same(tmp_path / "by1", tmp_path / other)


def test_flights_that_go_wrong_are_rows_and_the_others_are_there(tmp_path: Path) -> None:
    scenario = drawn()
    wanted = identity(scenario, 8, time_limit_s=4.0)
    with on_processes(2, wanted.time_limit_s) as engine:
        fly_into(tmp_path / "spoiled", scenario, wanted, engine=engine, fly=spoiled)
        fly_into(tmp_path / "whole", scenario, wanted, engine=engine)
    there, whole = table(tmp_path / "spoiled").to_pylist(), table(tmp_path / "whole").to_pylist()
    told = {row["index"]: row for row in there if row["outcome"] == "error"}
    assert {index: row["reason"] for index, row in told.items()} == {
        1: "RuntimeError: wings fell off",
        3: "took longer than the limit of 4 s of wall time",
        4: "took longer than the limit of 4 s of wall time",
        6: "worker died: signal 9",
    }
    assert "in spoiled" in told[1]["traceback"]
    assert "in spoiled" in told[3]["traceback"]
    assert told[4]["traceback"].endswith("in hang_without_python")
    for one, other in zip(there, whole, strict=True):
        assert one["draw.camera.noise_px"] == other["draw.camera.noise_px"]
        assert one["seed"] == one["index"]
        if one["outcome"] != "error":
            assert one["fused_cross_rms_m"] == other["fused_cross_rms_m"]
        else:
            assert (one["end"], one["in_box"]) == ("error", False)


class TestKeep:
    @pytest.mark.parametrize("which", ["none", "failures", "all"])
    def test_whole_flights_are_kept(self, which: Any, tmp_path: Path) -> None:
        scenario = drawn()
        job = next(jobs_of(scenario, identity(scenario, 5), [2]))
        row = fly_job(scenario, Keeper(tmp_path / "kept", which, write_run), job)
        kept = tmp_path / "kept" / "2"
        assert kept.is_dir() == (which != "none")
        if which != "none":
            assert {path.name for path in kept.iterdir()} == {"scenario.toml", "log.parquet", "metrics.json"}
            assert len(load_log(kept / "log.parquet")["time_s"]) == round(row["flight_time_s"] * 120) + 1
            assert f"noise_px = {job.draws['camera.noise_px']!r}" in (kept / "scenario.toml").read_text()

    def test_what_cannot_be_kept_stops_the_batch(self, tmp_path: Path) -> None:
        (tmp_path / "kept").write_text("in the way")
        with pytest.raises(KeepError):
            fly_job(short(), Keeper(tmp_path / "kept", "all", write_run), Job(0, 0))


class TestMerge:
    @pytest.fixture
    def shards(self, tmp_path: Path) -> list[Path]:
        scenario = short()
        for shard in ("1/3", "2/3", "3/3"):
            name = tmp_path / shard[0]
            fly_into(name, scenario, identity(scenario, 11, shard=shard, chunk=2), fly=made_up)
        fly_into(tmp_path / "whole", scenario, identity(scenario, 11), fly=made_up)
        return [tmp_path / name for name in "123"]

    def test_all_in_order(self, shards: list[Path], tmp_path: Path) -> None:
        (shards[1] / "kept" / "4").mkdir(parents=True)
        scenario, wanted = check_shards(shards[::-1])
        with open_batch(tmp_path / "merged", scenario, wanted, resume=False) as folder:
            merge(shards[::-1], folder)
        same(tmp_path / "merged", tmp_path / "whole")
        assert (tmp_path / "merged" / "kept" / "4").is_dir()

    def test_what_is_missing_or_strange_is_told(self, shards: list[Path], tmp_path: Path) -> None:
        def told(folders: list[Path]) -> str:
            with pytest.raises(InputError) as caught:
                check_shards(folders)
            return str(caught.value)

        scenario = short()
        assert "there are 2: shard 2/3 of the batch is missing" in told([shards[0], shards[2]])
        assert "1 is shard 1/3 alone: shards 2/3, 3/3 of the batch are missing" in told(shards[:1])
        assert "1: is named twice" in told([shards[0], shards[1], tmp_path / "x" / ".." / "1"])
        shutil.copytree(shards[0], tmp_path / "copy")
        assert "is shard 1/3, and so is" in told([shards[0], tmp_path / "copy", shards[1]])
        assert "is a whole batch, not a shard of one" in told([tmp_path / "whole"])
        for name, wanted, what in (
            ("n", identity(scenario, 12, shard="2/3"), "its n differs: 11 there and 12 here"),
            ("seed", identity(scenario, 11, seed=1, shard="2/3"), "its seed differs"),
            ("of", identity(scenario, 11, shard="2/4"), "is shard 2/4, but"),
        ):
            fly_into(tmp_path / name, scenario, wanted, fly=made_up)
            assert what in told([shards[0], tmp_path / name, shards[2]])
        other = short(**{"camera.noise_px": 0.3})
        fly_into(tmp_path / "other", other, identity(other, 11, shard="2/3"), fly=made_up)
        assert "its scenario differs" in told([shards[0], tmp_path / "other", shards[2]])
        (shards[1] / "flights.parquet").unlink()
        assert "4 of its 4 flights are missing" in told(shards)
        with pytest.raises(RunFolderError, match=r"is not a batch: batch\.json is missing"):
            check_shards([tmp_path])
