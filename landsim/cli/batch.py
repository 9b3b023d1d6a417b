"""Batches: batch, and merge for those that were flown in shards."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import NamedTemporaryFile
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from landsim.cli.common import echo_paths, load, positive, seed_of, set_option
from landsim.cli.finish import clear_report, print_batch, report, summarised
from landsim.terminal import (
    EXIT_BAD_INPUT,
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    FlightRate,
    fail,
    flight_progress,
    printing,
    shown,
    status,
    tell,
)

if TYPE_CHECKING:
    from landsim.batch.chunks import BatchStopped
    from landsim.batch.engine import Engine
    from landsim.batch.folder import BatchFolder
    from landsim.batch.identity import Identity
    from landsim.config import Scenario

TIME_LIMIT_S = 60.0
CHUNK = 25
MOST_WORKERS = 1024
ENGINES = ("processes", "dask")
KEEP = ("none", "failures", "all")

no_report_option = click.option(
    "--no-report", is_flag=True, help="Draw no figures and write no report; landsim plot DIR does it later."
)


@click.command()
@click.argument("scenario")
@click.option("-n", "n", metavar="N", callback=positive, help="Flights; with --resume as many as there were, or more.")
@click.option("--seed", metavar="N", callback=seed_of, help="Of the first flight; the i-th has N + i.  [default: 0]")
@click.option("--workers", metavar="K", callback=positive, help="Flights at a time.  [default: the number of cores]")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the batch.  [default: runs/NNN-SCENARIO, numbered]",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Go on with the batch in --out: with the same SCENARIO and --set, and -n if it is to grow.",
)
@click.option("--engine", type=click.Choice(ENGINES), default=ENGINES[0], help="Who flies.  [default: processes]")
@click.option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster, as tcp://host:8786.  [default: an own one]")
@click.option("--shard", metavar="I/N", help="Fly every N-th flight from the I-th on; landsim merge joins the shards.")
@click.option(
    "--keep",
    type=click.Choice(KEEP),
    help="Keep the logs of failures (all but landings in the box), or of all flights, in kept/INDEX.  [default: none]",
)
@click.option(
    "--time-limit",
    type=float,
    metavar="SECONDS",
    help=f"Of wall time for a flight; one that takes longer is ended, and is an error.  [default: {TIME_LIMIT_S:g}]",
)
@click.option(
    "--chunk", metavar="K", callback=positive, help=f"Flights that are written at a time.  [default: {CHUNK}]"
)
@set_option
@no_report_option
def batch(
    scenario: str,
    n: int | None,
    seed: int | None,
    workers: int | None,
    out: Path | None,
    resume: bool,
    engine: str,
    scheduler: str | None,
    shard: str | None,
    keep: Any,
    time_limit: float | None,
    chunk: int | None,
    settings: tuple[str, ...],
    no_report: bool,
) -> None:
    """Fly SCENARIO N times, each time with another seed, and report how often, how well and how surely it lands.

    Every flight is a row of DIR/flights.parquet, which does not depend on who flies it.  Curves of 95 % begin at 20
    flights; sobol sampling is balanced when N is a power of two.

    An interrupted batch goes on with --resume, SCENARIO, the same --set and --out DIR.  What else makes the batch
    (--seed, --shard, --keep, --time-limit, --chunk, -n) is that of DIR if it is not said, and if it is, must be the
    same, but that N may be larger: not of a latin-hypercube, which cannot grow.  Who flies (--workers, --engine,
    --scheduler) may change.
    """
    from landsim.batch.chunks import BatchStopped
    from landsim.batch.folder import check_new, check_same, is_batch, open_batch
    from landsim.batch.identity import Shard, identify, read_identity
    from landsim.batch.pool import cores
    from landsim.runs import numbered_folder

    if resume and out is None:
        raise click.UsageError("--resume needs --out DIR, the folder of the batch that is to go on.")
    if scheduler is not None and engine != "dask":
        raise click.UsageError("--scheduler is of a Dask cluster, and needs --engine dask.")
    if scheduler is not None and workers is not None:
        raise click.UsageError("--workers is of this machine; with --scheduler the cluster's own workers fly.")
    if workers is not None and workers > MOST_WORKERS:
        raise click.UsageError(f"--workers must be at most {MOST_WORKERS}, not {workers}.")
    loaded, flown_seed = load(scenario, settings)
    stored = read_identity(out) if resume and out is not None else None
    if n is None:
        if stored is None:
            raise click.UsageError("-n N is missing: how many flights?")
        n = stored.n
    wanted = identify(
        loaded,
        n,
        seed if seed is not None else stored.seed if stored else flown_seed or 0,
        Shard.parse(shard) if shard is not None else stored.shard if stored else Shard(),
        keep or (stored.keep if stored else "none"),
        time_limit if time_limit is not None else stored.time_limit_s if stored else TIME_LIMIT_S,
        chunk if chunk is not None else stored.chunk if stored else CHUNK,
    )
    if out is not None:
        out = out.expanduser().absolute()
        if resume:
            check_same(out, loaded, wanted)
        else:
            check_new(out)
    _check_draws(loaded, wanted)
    count = cores() if workers is None else workers
    flown: dict[str, Any] = {"engine": engine}
    place = out
    try:
        with _engine(engine, scheduler, count, loaded, wanted, out) as flies:
            place = out or numbered_folder(loaded.name).absolute()
            with open_batch(place, loaded, wanted, resume=resume) as folder:
                if resume:
                    clear_report(place, len(wanted.indices()))
                flown |= _fly(folder, loaded, flies)
                if scheduler is None:
                    flown["workers"] = count
        _finish(place, loaded, wanted, flown, draw=not no_report)
    except BatchStopped as stopped:
        fail(f"{stopped}; {_to_go_on(scenario, settings, place, engine, scheduler, workers)}", _code(stopped))
    except KeyboardInterrupt:
        if place is None or not is_batch(place):
            raise
        fail(f"interrupted; {_to_go_on(scenario, settings, place, engine, scheduler, workers)}", EXIT_INTERRUPTED)


@click.command()
@click.argument("folders", nargs=-1, required=True, metavar="DIR...", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the batch.  [default: runs/NNN-SCENARIO, numbered]",
)
@no_report_option
def merge(folders: tuple[Path, ...], out: Path | None, no_report: bool) -> None:
    """Join the shards of a batch, each in a DIR, to one batch with its report."""
    from landsim.batch.chunks import BatchStopped
    from landsim.batch.folder import check_new, open_batch
    from landsim.batch.merge import check_shards
    from landsim.batch.merge import merge as joined
    from landsim.runs import numbered_folder

    scenario, identity = check_shards(folders)
    if out is not None:
        out = out.expanduser().absolute()
        check_new(out)
    place = out or numbered_folder(scenario.name).absolute()
    try:
        with status("merging"), open_batch(place, scenario, identity, resume=False) as folder:
            joined(folders, folder)
        _finish(place, scenario, identity, {}, draw=not no_report)
    except BatchStopped as stopped:
        fail(str(stopped), _code(stopped))


def _code(stopped: "BatchStopped") -> int:
    """Of the exit: a full disk is the user's to mend, an engine that has given up is not."""
    from landsim.batch.chunks import NotWrittenError

    return EXIT_BAD_INPUT if isinstance(stopped, NotWrittenError) else EXIT_FAILURE


def _check_draws(scenario: "Scenario", identity: "Identity") -> None:
    """Refuse a batch of which a flight has a value that the scenario does not allow."""
    if scenario.dispersions is None:
        return
    from landsim.dispersion import Design, check_draws

    design = Design(scenario, identity.seed, identity.n)
    check_draws(scenario, (design.draws(index) for index in range(identity.n)))


@contextmanager
def _engine(
    name: str, scheduler: str | None, count: int, scenario: "Scenario", identity: "Identity", out: Path | None
) -> "Iterator[Engine]":
    """Who flies; refused before anything is written, if it does not answer."""
    from contextlib import ExitStack

    with ExitStack() as stack:
        if name == "dask":
            from landsim.batch.cluster import on_dask

            sought = None
            if (
                scheduler is not None and identity.keep != "none"
            ):  # every worker is to find what stands beside the batch
                sought = stack.enter_context(_sought(out or Path()))
            flies = on_dask(scheduler, count, identity.time_limit_s, scenario.aircraft_config.folder, sought)
        else:
            from landsim.batch.engine import on_processes

            flies = on_processes(count, identity.time_limit_s)
        yield stack.enter_context(flies)


@contextmanager
def _sought(out: Path) -> Iterator[Path]:
    """A file in the nearest folder that there is above a new one, for as long as it is looked for."""
    from landsim.errors import RunFolderError

    above = next(folder for folder in (out.absolute(), *out.absolute().parents) if folder.is_dir())
    try:
        file = NamedTemporaryFile(dir=above, prefix=".landsim-")  # noqa: SIM115
    except OSError as error:
        raise RunFolderError(f"{out}: cannot be written: {error.strerror}") from None
    with file:
        yield Path(file.name)


def _fly(folder: "BatchFolder", scenario: "Scenario", engine: "Engine") -> dict[str, Any]:
    """Fly what has not been flown, and tell how it goes; how long the batch took, if all of it was flown now."""
    from landsim.batch.engine import fly_batch
    from landsim.batch.folder import KEPT
    from landsim.batch.identity import flights
    from landsim.batch.job import Keeper
    from landsim.runs import write_run

    for path in folder.chunks.damaged:
        tell(f"{shown(path)}: could not be read, and is set aside; its flights are flown again")
    identity = folder.identity
    keeper = None if identity.keep == "none" else Keeper(folder.path / KEPT, identity.keep, write_run)
    rate = FlightRate(len(identity.indices()), folder.done)
    begin, before = perf_counter(), folder.done
    with flight_progress(f"{scenario.name}, seed {identity.seed}", rate) as count:
        fly_batch(folder, scenario, engine, keeper, lambda row: count(bool(row["in_box"])))
    folder.finish()
    taken = perf_counter() - begin
    if rate.flown:
        speed = "" if rate.per_second is None else f", {rate.per_second:.2f} a second once it had started"
        tell(f"{flights(rate.flown)} in {taken:.1f} s{speed}")
    return {} if before else {"wall_time_s": taken}


def _finish(folder: Path, scenario: "Scenario", identity: "Identity", flown: dict[str, Any], *, draw: bool) -> None:
    """Summary and report of a batch that is complete, and its tables; of a shard, nothing but where it is."""
    from landsim.errors import RunFolderError

    paths: list[Path] = []
    summary = None
    if identity.shard.of == 1:
        try:
            with status("summing up") as say:
                summary = summarised(folder, scenario, identity, flown)
                if draw:
                    say("drawing")
                    paths = report(folder, scenario, summary)
        except RunFolderError as error:
            fail(f"{error}; every flight is kept, and landsim plot {shown(folder)} reports them", EXIT_BAD_INPUT)
    with printing(f"{shown(folder)}: the batch is there"):
        click.echo(shown(folder))
        if summary is None:
            click.echo(f"shard {identity.shard} is complete; with the others: landsim merge {shown(folder)} DIR...")
        else:
            print_batch(summary)
        click.echo("written:")
        own = ["batch.json", "flights.parquet", "scenario.toml", *(["summary.json"] if summary is not None else [])]
        echo_paths(folder, sorted({*own, *(str(path.relative_to(folder)) for path in paths)}))


def _to_go_on(
    scenario: str,
    settings: tuple[str, ...],
    folder: Path | None,
    engine: str,
    scheduler: str | None,
    workers: int | None,
) -> str:
    """The command that goes on with a batch."""
    words = ["landsim", "batch", scenario, *(word for setting in settings for word in ("--set", setting))]
    words += ["--engine", engine] if engine != ENGINES[0] else []
    words += [] if scheduler is None else ["--scheduler", scheduler]
    words += [] if workers is None else ["--workers", str(workers)]
    words += ["--resume", "--out", "DIR" if folder is None else shown(folder)]
    return f"what was flown is kept; to go on: {shlex.join(words)}"
