"""Batches on a Dask cluster of processes: a scheduler and workers of their own, on this machine's loopback."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from batches import SHORT, drawn, fly_into, identity, same, short, spoiled, table

from landsim import cli
from landsim.batch import cluster
from landsim.batch.cluster import on_dask
from landsim.batch.engine import on_processes
from landsim.errors import InputError

REPOSITORY = Path(__file__).resolve().parents[1]
SETTINGS = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]


class Cluster:
    """A scheduler and its workers; those are processes without nannies unless asked for."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        self._begin("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-jupyter")

    def worker(self, *options: str) -> "subprocess.Popen[bytes]":
        where = ("--host", "127.0.0.1", "--local-directory", str(self.folder), "--no-dashboard")
        return self._begin("worker", self.address, *where, *(options or ("--no-nanny", "--nthreads", "1")))

    def _begin(self, *arguments: str) -> "subprocess.Popen[bytes]":
        paths = f"{REPOSITORY}{os.pathsep}{Path(__file__).parent}"
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
            env=os.environ | {"PYTHONPATH": paths},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def end(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.wait(30)


@contextmanager
def begun(folder: Path) -> Iterator[Cluster]:
    made = Cluster(folder)
    try:
        yield made
    finally:
        made.end()


@pytest.fixture
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with begun(tmp_path_factory.mktemp("workers")) as made:
        yield made


def test_rows_are_those_of_processes_whatever_the_workers(dask: Cluster, tmp_path: Path) -> None:
    """A worker of one thread, one of two, and one with a nanny; flights that raise, hang and kill are rows."""
    dask.worker()
    dask.worker("--no-nanny", "--nthreads", "2")
    dask.worker("--nanny", "--nthreads", "1")
    scenario = drawn("sobol")
    wanted = identity(scenario, 10, time_limit_s=4.0)
    with on_dask(dask.address, 1, 4.0, scenario.aircraft_config.folder, None) as engine:
        fly_into(tmp_path / "dask", scenario, wanted, engine=engine)
        fly_into(tmp_path / "spoiled", scenario, wanted, engine=engine, fly=spoiled)
    with on_processes(2, 4.0) as engine:
        fly_into(tmp_path / "here", scenario, wanted, engine=engine)
    same(tmp_path / "dask", tmp_path / "here")
    reasons = {row["index"]: row["reason"] for row in table(tmp_path / "spoiled").to_pylist() if row["end"] == "error"}
    assert reasons == {
        1: "RuntimeError: wings fell off",
        3: "took longer than the limit of 4 s of wall time",
        4: "took longer than the limit of 4 s of wall time",
        6: "worker died: signal 9",
    }


@pytest.mark.slow
def test_flights_of_a_killed_worker_are_flown_by_another(dask: Cluster, tmp_path: Path) -> None:
    scenario = short()
    first, _ = dask.worker(), dask.worker()
    with on_processes(1, 60.0) as engine:
        fly_into(tmp_path / "here", scenario, identity(scenario, 12), engine=engine)
    killed = False

    def kill(_: object) -> None:
        nonlocal killed
        if not killed:
            first.kill()
            killed = True

    with on_dask(dask.address, 1, 60.0, scenario.aircraft_config.folder, None) as engine:
        fly_into(tmp_path / "dask", scenario, identity(scenario, 12), engine=engine, progress=kill)
    assert first.wait(30) == -signal.SIGKILL
    same(tmp_path / "dask", tmp_path / "here")


@pytest.mark.slow
def test_no_process_of_a_batch_is_left_on_a_worker(dask: Cluster, tmp_path: Path) -> None:
    worker = dask.worker()
    scenario = short()
    with on_dask(dask.address, 1, 60.0, scenario.aircraft_config.folder, None) as engine:
        fly_into(tmp_path / "b", scenario, identity(scenario, 2), engine=engine)
        assert children(worker.pid)
    for _ in range(200):
        if not children(worker.pid):
            return
        time.sleep(0.05)
    pytest.fail("its processes are still there")


def children(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split() + [
        child
        for task in Path(f"/proc/{pid}/task").iterdir()
        if task.name != str(pid)
        for child in (task / "children").read_text().split()
    ]


Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def landsim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            cli.main(["batch", "landing", *SETTINGS, "-n", "5", "--engine", "dask", "--no-report", *arguments])
        printed = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, printed.out, printed.err

    return run


def test_by_the_command_line(dask: Cluster, landsim: Run, tmp_path: Path) -> None:
    dask.worker()
    code, out, err = landsim("--scheduler", dask.address, "--out", "b", "--keep", "all")
    assert code == 0, err
    assert out.splitlines()[0] == "b"
    assert [line for line in err.splitlines() if " flights in " not in line] == []
    assert {path.name for path in (tmp_path / "b" / "kept").iterdir()} == set("01234")
    code, _, err = landsim("--workers", "1", "--out", "own")
    assert code == 0, err
    same(tmp_path / "b", tmp_path / "own")


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:1", "127.0.0.1:1", "nosuch.invalid:8786", "bogus://x", "localhost", ""]
)
def test_a_scheduler_that_is_not_there(
    address: str, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    code, out, err = landsim("--scheduler", address, "--out", "b")
    assert (code, out, len(err.splitlines())) == (2, "", 1), err
    assert "no Dask scheduler answers there" in err
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_that_cannot_fly(
    dask: Cluster, landsim: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as hasty:
        hasty.setattr(cluster, "WORKER_S", 3.0)
        code, _, err = landsim("--scheduler", dask.address, "--out", "b")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "has no workers; begin some with: dask worker tcp://" in err
    dask.worker()
    monkeypatch.setattr(cluster, "versions", lambda: {"numpy": "1.0"})
    code, _, err = landsim("--scheduler", dask.address, "--out", "b")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "has other versions: " in err
    assert not (tmp_path / "b").exists()
    aircraft = short().aircraft_config.folder / "elsewhere"
    monkeypatch.undo()
    with (
        pytest.raises(InputError, match=r"has no folder .*elsewhere, where the aircraft is"),
        on_dask(dask.address, 1, 60.0, aircraft, None),
    ):
        pass


def test_without_the_package_it_is_told_what_to_install(landsim: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, err = landsim()
    assert (code, len(err.splitlines())) == (2, 1)
    assert "pip install 'landsim[cluster]'" in err
