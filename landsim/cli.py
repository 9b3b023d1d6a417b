"""The command line: the only place that parses arguments and prints.

Exit codes: 0, it ran, whatever the landing was and whoever reads of it; 2, bad input or usage, told in one line on
stderr, nothing written; 1, a failure of landsim's own; 130, interrupted or terminated.  Heavy libraries are imported by
the commands that need them.
"""

import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click

from landsim import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from landsim.config import Scenario
    from landsim.log import Log

EXIT_FAILURE = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
SEED_DIGITS = 1000
DEBUG_VARIABLE = "LANDSIM_DEBUG"
THREAD_VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
WIDTH = 100
"""Of tables that are not printed to a terminal."""

set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a key of the scenario, as --set camera.rate_hz=15.0; may be repeated.",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(__version__, prog_name="landsim")
def landsim() -> None:
    """Fly vision-guided landings in JSBSim.

    SCENARIO is the name of a shipped scenario (see: landsim list), the path of a TOML file, or the folder of a run,
    whose scenario it then is; a shipped name wins over a folder (./NAME is the folder).
    """


@landsim.command("list")
def list_command() -> None:
    """List the shipped scenarios and aircraft."""
    import tomllib

    from landsim import resources

    scenarios = {name: resources.first_line(path) for name, path in resources.shipped_scenarios().items()}
    aircraft = {}
    for name, folder in resources.shipped_aircraft().items():
        with (folder / resources.AIRCRAFT_FILE).open("rb") as file:
            aircraft[name] = str(tomllib.load(file).get("title", ""))
    width = max(map(len, (*scenarios, *aircraft)), default=0)
    with _printing():
        for heading, entries in (("scenarios", scenarios), ("aircraft", aircraft)):
            click.echo(heading)
            for name, text in entries.items():
                click.echo(f"  {name:<{width}}  {text}")


@landsim.command()
@click.argument("scenario")
@set_option
def check(scenario: str, settings: tuple[str, ...]) -> None:
    """Validate SCENARIO, load its aircraft into JSBSim, and print the scenario with every key.

    What is printed is a TOML file of the same flight.
    """
    from landsim.config import resolved_toml
    from landsim.errors import one_line

    loaded, _ = _load(scenario, settings)
    with _printing():
        click.echo(one_line(f"# {loaded.name}: {loaded.path}; aircraft: {loaded.aircraft_config.title}"))
        click.echo(resolved_toml(loaded), nl=False)


def _seed(context: click.Context, option: click.Parameter, value: str | None) -> int | None:
    """A whole number, not negative, in decimal digits."""
    if value is None:
        return None
    if not (value.isascii() and value.isdigit() and len(value) <= SEED_DIGITS):
        message = f"must be a whole number, 0 or more, not {value or 'nothing'}"
        raise click.BadParameter(message, context, option)
    return int(value)


@landsim.command()
@click.argument("scenario")
@click.option(
    "--seed", metavar="N", callback=_seed, help="Of everything random.  [default: 0, or that of the run named]"
)
@set_option
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the run.  [default: runs/NNN-SCENARIO, numbered]",
)
@click.option("--no-plots", is_flag=True, help="Draw no pictures; landsim plot DIR draws them later.")
def run(scenario: str, seed: int | None, settings: tuple[str, ...], out: Path | None, no_plots: bool) -> None:
    """Fly SCENARIO once and keep its log, metrics and pictures.

    Of the folder of a run, fly the same again: its scenario, by the same name, with its seed.
    """
    from time import perf_counter

    from landsim.config import ScenarioError
    from landsim.runs import as_json, new_run, write_run
    from landsim.tables import flight_tables

    begin = perf_counter()
    loaded, flown_seed = _load(scenario, settings)
    if loaded.kind != "flight":
        raise ScenarioError(
            f'{loaded.path}: kind: must be "flight" to be run, not "{loaded.kind}":'
            " studies are not built in this version"
        )
    if seed is None:
        seed = flown_seed or 0
    with new_run(loaded.name, out) as place:
        with _status(f"flying {loaded.name}, seed {seed}") as say:
            from landsim.simulate import fly

            flight = fly(loaded, seed=seed)
            metrics = as_json(flight.metrics)
            write_run(place.temporary, loaded, flight)
            if not no_plots:
                say("drawing")
                _draw(place.temporary, loaded, flight.log, metrics)
        names = sorted(path.name for path in place.temporary.iterdir())
    taken = perf_counter() - begin
    with _printing(f"{_shown(place.final)}: the run is there"):
        click.echo(_shown(place.final))  # first, so that who reads no further knows
        console = _console()
        with console.capture() as text:  # rich would end the process where the reader has gone
            for table in flight_tables(metrics, console.width):
                console.print(table, crop=False)
        sys.stdout.write(text.get())
        click.echo(f"flown in {metrics['wall_time_s']:.2f} s, all in {taken:.1f} s; written:")
        _echo_paths(place.final, names)


@landsim.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def plot(folder: Path) -> None:
    """Draw the pictures of the run in DIR again."""
    from landsim.runs import read_run

    flown = read_run(folder)
    with _status("drawing"):
        paths = _draw(folder, flown.scenario, flown.log, flown.metrics)
    with _printing(f"{_shown(folder)}: the pictures are there"):
        _echo_paths(folder, sorted(path.name for path in paths))


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit; the entry point of the ``landsim`` script."""
    # The filter's small matrices are slower on several threads, and a result must not depend on how many there are.
    # It has to be settled before numpy is imported.
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    debug = bool(os.environ.get(DEBUG_VARIABLE))
    _make_printable()
    try:
        with _terminable():
            code: Any = landsim.main(arguments, prog_name="landsim", standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "landsim"
        _fail(f"{error.format_message()}  See: {where} --help", EXIT_BAD_INPUT)
    except click.ClickException as error:
        _fail(error.format_message(), EXIT_BAD_INPUT)
    except (click.Abort, KeyboardInterrupt):
        sys.exit(EXIT_INTERRUPTED)
    except Exception as error:
        from landsim.errors import InputError

        if debug:
            raise
        if isinstance(error, InputError):
            _fail(str(error), EXIT_BAD_INPUT)
        text = f"{type(error).__name__}: {error}"
        _fail(f"{text} (a fault of landsim; {DEBUG_VARIABLE}=1 shows where)", EXIT_FAILURE)
    with _printing():  # what click itself printed
        pass
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int) -> NoReturn:
    _tell(message)
    sys.exit(code)


def _tell(message: str) -> None:
    """A line on stderr, if anything can be written there."""
    from landsim.errors import one_line

    try:
        click.echo(f"landsim: {one_line(message)}", err=True)
        sys.stderr.flush()
    except OSError:
        _discard(sys.stderr)


def _make_printable() -> None:
    """Standard streams that take every character, and that are there."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started this process
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


@contextmanager
def _terminable() -> Iterator[None]:
    """Within it SIGTERM interrupts like Ctrl-C, so that nothing half-written stays behind; a second one is ignored."""

    def interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise KeyboardInterrupt

    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if ours:
        signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _printing(done: str = "") -> Iterator[None]:
    """Within it a reader of stdout who has gone is no failure, and nor is a full disk if something is ``done``."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        _discard(sys.stdout)
        if isinstance(error, BrokenPipeError):
            return
        reason = f"standard output cannot be written: {error.strerror}"
        if not done:
            _fail(reason, EXIT_FAILURE)
        _tell(f"{done}; {reason}")


def _discard(stream: Any) -> None:
    """Let what is still in the stream's buffer go nowhere, where Python would complain about it at exit."""
    with suppress(OSError, ValueError):  # a stand-in without a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _load(scenario: str, settings: tuple[str, ...]) -> "tuple[Scenario, int | None]":
    """The scenario, its aircraft found to load into JSBSim, and the seed if it is that of a run."""
    from landsim.errors import InputError
    from landsim.plant import Plant
    from landsim.runs import load_flight
    from landsim.runway import Runway

    try:
        Path.cwd()
    except OSError:  # JSBSim asks for it
        raise InputError("the working directory is not there any more; change to another") from None
    loaded, seed = load_flight(scenario, _overrides(settings))
    aircraft, runway = loaded.aircraft_config, Runway(length=loaded.runway.length_m, width=loaded.runway.width_m)
    Plant(aircraft.folder, aircraft.model, runway, loaded.simulation.rate_hz)
    return loaded, seed


def _overrides(settings: tuple[str, ...]) -> dict[str, object]:
    from landsim.config import parse_setting

    return dict(parse_setting(text) for text in settings)


def _draw(folder: Path, scenario: "Scenario", log: "Log", metrics: dict[str, Any]) -> list[Path]:
    from landsim.errors import RunFolderError
    from landsim.report import draw_run

    try:
        return draw_run(folder, scenario, log, metrics)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None


def _console(*, stderr: bool = False) -> "Console":
    from rich.console import Console

    from landsim.tables import NARROWEST

    console = Console(stderr=stderr, highlight=False)
    console.width = max(console.width, NARROWEST) if console.is_terminal else WIDTH
    return console


def _echo_paths(folder: Path, names: list[str]) -> None:
    for name in names:
        click.echo(f"  {_shown(folder / name)}")


def _shown(path: Path) -> str:
    """The path as it is printed: from the working directory if it is below that, and on one line."""
    from landsim.errors import one_line

    with suppress(OSError, ValueError):  # no working directory any more, or not below it
        path = path.relative_to(Path.cwd())
    return one_line(str(path))


@contextmanager
def _status(text: str) -> "Iterator[Callable[[str], None]]":
    """A line that lives while something is done, on a terminal only; what it yields changes its text."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.text import Text

    with _console(stderr=True).status(Text(text)) as status:
        yield lambda changed: status.update(Text(changed))


if __name__ == "__main__":
    main()
