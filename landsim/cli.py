"""The command line: the only place that parses arguments and prints.

Exit codes: 0, it ran, whatever the landing was; 2, bad input or usage, told in one line on stderr, nothing written;
1, a failure of landsim's own; 130, interrupted.  Heavy libraries are imported by the commands that need them.
"""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from landsim import __version__

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from landsim.config import Scenario
    from landsim.log import Log

EXIT_FAILURE = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
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

    SCENARIO is the name of a shipped scenario (see: landsim list) or the path of a TOML file.
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
    for heading, entries in (("scenarios", scenarios), ("aircraft", aircraft)):
        click.echo(heading)
        for name, text in entries.items():
            click.echo(f"  {name:<{width}}  {text}")


@landsim.command()
@click.argument("scenario")
@set_option
def check(scenario: str, settings: tuple[str, ...]) -> None:
    """Validate SCENARIO and print it with every key.

    What is printed is a TOML file of the same flight.
    """
    from landsim.config import load_scenario, resolved_toml

    loaded = load_scenario(scenario, _overrides(settings))
    click.echo(f"# {loaded.name}: {loaded.path}; aircraft: {loaded.aircraft_config.title}")
    click.echo(resolved_toml(loaded), nl=False)


@landsim.command()
@click.argument("scenario")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of everything random.")
@set_option
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the run.  [default: runs/NNN-SCENARIO, numbered]",
)
@click.option("--no-plots", is_flag=True, help="Draw no pictures; landsim plot DIR draws them later.")
def run(scenario: str, seed: int, settings: tuple[str, ...], out: Path | None, no_plots: bool) -> None:
    """Fly SCENARIO once and keep its log, metrics and pictures."""
    from time import perf_counter

    from landsim.config import ScenarioError, load_scenario
    from landsim.runs import as_json, new_run, write_run
    from landsim.tables import flight_tables

    begin = perf_counter()
    loaded = load_scenario(scenario, _overrides(settings))
    if loaded.kind != "flight":
        raise ScenarioError(f'{loaded.path}: kind: must be "flight" to be run, not "{loaded.kind}"')
    with new_run(loaded.name, out) as place:
        with _status(f"flying {loaded.name}, seed {seed}") as status:
            from landsim.simulate import fly

            flight = fly(loaded, seed=seed)
            metrics = as_json(flight.metrics)
            write_run(place.temporary, loaded, flight)
            if not no_plots:
                status.update("drawing")
                _draw(place.temporary, loaded, flight.log, metrics)
        names = sorted(path.name for path in place.temporary.iterdir())
    console = _console()
    for table in flight_tables(metrics):
        console.print(table)
    click.echo(f"flown in {metrics['wall_time_s']:.2f} s, all in {perf_counter() - begin:.1f} s; written:")
    _echo_paths(place.final, names)


@landsim.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def plot(folder: Path) -> None:
    """Draw the pictures of the run in DIR again."""
    from landsim.runs import read_run

    flown = read_run(folder)
    with _status("drawing"):
        paths = _draw(folder, flown.scenario, flown.log, flown.metrics)
    _echo_paths(folder, sorted(path.name for path in paths))


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit; the entry point of the ``landsim`` script."""
    # The filter's small matrices are slower on several threads, and a result must not depend on how many there are.
    # It has to be settled before numpy is imported.
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    debug = bool(os.environ.get(DEBUG_VARIABLE))
    try:
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
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int) -> NoReturn:
    from landsim.errors import one_line

    click.echo(f"landsim: {one_line(message)}", err=True)
    sys.exit(code)


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

    terminal = (sys.stderr if stderr else sys.stdout).isatty()
    return Console(stderr=stderr, width=None if terminal else WIDTH, highlight=False)


def _echo_paths(folder: Path, names: list[str]) -> None:
    here = Path.cwd()
    shown = folder.relative_to(here) if folder.is_relative_to(here) else folder
    for name in names:
        click.echo(f"  {shown / name}")


def _status(text: str) -> "Status":
    """A line that lives while something is done; on a terminal only."""
    from rich.text import Text

    return _console(stderr=True).status(Text(text))


if __name__ == "__main__":
    main()
