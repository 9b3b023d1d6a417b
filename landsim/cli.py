"""The command line: the only place that parses arguments and prints.

Exit codes: 0, it ran, whatever the landing was and whoever reads of it; 2, bad input or usage, told in one line on
stderr, nothing written; 1, a failure of landsim's own; 130, interrupted or terminated.  Heavy libraries are imported by
the commands that need them.
"""

import itertools
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from landsim import __version__
from landsim.terminal import (
    EXIT_BAD_INPUT,
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    after,
    fail,
    make_printable,
    print_tables,
    printing,
    progress_bar,
    shown,
    status,
    terminable,
)
from landsim.threads import THREAD_VARIABLES

if TYPE_CHECKING:
    from landsim.budget.result import Order
    from landsim.config import Scenario
    from landsim.log import Log
    from landsim.study.model import Envelope

SEED_DIGITS = 1000
PATIENCE_S = 5.0
DEBUG_VARIABLE = "LANDSIM_DEBUG"

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
    with printing():
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
    if loaded.kind == "study":
        from landsim.study.plan import plan_of

        plan_of(loaded)
    with printing():
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
    """Fly SCENARIO once and keep its log, metrics and pictures; a study: its verdict and figures.

    Of the folder of a run, fly the same again: its scenario, by the same name, with its seed.
    """
    from time import perf_counter

    from landsim.plain import as_json
    from landsim.runs import new_run, write_run
    from landsim.tables import flight_tables

    begin = perf_counter()
    loaded, flown_seed = _load(scenario, settings)
    if seed is None:
        seed = flown_seed or 0
    if loaded.kind == "study":
        _run_study(loaded, seed, out, plots=not no_plots)
        return
    with new_run(loaded.name, out) as place:
        doing = f"flying {loaded.name}, seed {seed}"
        with status(doing) as say:
            with after(PATIENCE_S, lambda: say(f"{doing}; a first flight compiles, half a minute")):
                from landsim.simulate import fly

                flight = fly(loaded, seed=seed)
            metrics = as_json(flight.metrics)
            write_run(place.temporary, loaded, flight)
            if not no_plots:
                say("drawing")
                _draw(place.temporary, loaded, flight.log, metrics)
        names = sorted(path.name for path in place.temporary.iterdir())
    taken = perf_counter() - begin
    with printing(f"{shown(place.final)}: the run is there"):
        click.echo(shown(place.final))  # first, so that who reads no further knows
        print_tables(lambda width: flight_tables(metrics, width))
        click.echo(f"flown in {metrics['wall_time_s']:.2f} s, all in {taken:.1f} s; written:")
        _echo_paths(place.final, names)


@landsim.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def plot(folder: Path) -> None:
    """Draw the pictures of the run or the study in DIR again."""
    from landsim.runs import read_run
    from landsim.study.folder import VERDICT_FILE, read_study

    if (folder / VERDICT_FILE).is_file():
        study = read_study(folder)
        with status("drawing"):
            paths = _draw_study(folder, study.scenario, study.envelopes, study.verdict)
    else:
        flown = read_run(folder)
        with status("drawing"):
            paths = _draw(folder, flown.scenario, flown.log, flown.metrics)
    with printing(f"{shown(folder)}: the pictures are there"):
        _echo_paths(folder, sorted(path.name for path in paths))


@landsim.command()
@click.argument("scenario", default="landing")
@click.option(
    "--require",
    "required",
    multiple=True,
    metavar="WHAT=BOUND@RANGE",
    help="A bound on the error of roll, pitch, yaw (degrees), cross, altitude or along (metres), so many metres before"
    " the threshold (negative past it), as altitude=0.5@600; may be repeated.",
)
@click.option(
    "--requirements", "file", type=click.Path(path_type=Path), metavar="FILE", help="TOML file of such bounds."
)
@click.option(
    "--confidence", type=float, default=95.0, metavar="PERCENT", help="Of frames within a bound.  [default: 95]"
)
@click.option(
    "--precision", type=float, metavar="PX", help="σ of the lines' points: tell from which range on each bound holds."
)
@click.option(
    "--roll-error-deg",
    type=float,
    default=0.0,
    metavar="DEG",
    help="Of the roll angle given to two lines.  [default: 0]",
)
@click.option(
    "--sweep",
    "swept",
    multiple=True,
    metavar="WHAT[=LOW:HIGH[:N]]",
    help="Draw what is needed against focal-length, image-size, runway-width, runway-length, tilt, resolution,"
    " image-width or image-height; may be repeated.  [default: the first five]",
)
@click.option(
    "--confirm", "draws", type=int, default=0, metavar="N", help="Draw each need N times, with real line fits."
)
@click.option("--seed", metavar="N", callback=_seed, help="Of the draws.  [default: 0]")
@set_option
@click.option(
    "--plot", "figure", type=click.Path(path_type=Path), metavar="FILE", help="Figure of the sweeps, PNG or PDF."
)
@click.option("--json", "as_text", is_flag=True, help="Print JSON in place of the tables.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for budget.json, budget.png and budget.pdf.",
)
def budget(
    scenario: str,
    required: tuple[str, ...],
    file: Path | None,
    confidence: float,
    precision: float | None,
    roll_error_deg: float,
    swept: tuple[str, ...],
    draws: int,
    seed: int | None,
    settings: tuple[str, ...],
    figure: Path | None,
    as_text: bool,
    out: Path | None,
) -> None:
    """Tell what the image lines must be worth for bounds on the pose's errors to hold.

    The camera, the runway and the approach are those of SCENARIO, by default of landing.  To first order, the noise of
    the lines read in both ways: as that of their two ends, and as that of points along them.
    """
    from landsim.budget.order import order_of
    from landsim.runs import load_flight

    loaded, _ = load_flight(scenario, _overrides(settings))
    order = order_of(
        required=required,
        file=file,
        confidence_percent=confidence,
        roll_error_deg=roll_error_deg,
        precision_px=precision,
        swept=swept,
        drawn=figure is not None or out is not None,
        shown=as_text,
        draws=draws,
        seed=seed or 0,
    )
    _budget(loaded, order, figure, out, as_text=as_text)


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit; the entry point of the ``landsim`` script."""
    # The filter's small matrices are slower on several threads, and a result must not depend on how many there are.
    # It has to be settled before numpy is imported.
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    debug = bool(os.environ.get(DEBUG_VARIABLE))
    make_printable()
    try:
        with terminable():
            code: Any = landsim.main(arguments, prog_name="landsim", standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "landsim"
        fail(f"{error.format_message()}  See: {where} --help", EXIT_BAD_INPUT)
    except click.ClickException as error:
        fail(error.format_message(), EXIT_BAD_INPUT)
    except (click.Abort, KeyboardInterrupt):
        sys.exit(EXIT_INTERRUPTED)
    except Exception as error:
        from landsim.errors import InputError

        if debug:
            raise
        if isinstance(error, InputError):
            fail(str(error), EXIT_BAD_INPUT)
        text = f"{type(error).__name__}: {error}"
        fail(f"{text} (a fault of landsim; {DEBUG_VARIABLE}=1 shows where)", EXIT_FAILURE)
    with printing():  # what click itself printed
        pass
    sys.exit(code if isinstance(code, int) else 0)


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


def _run_study(scenario: "Scenario", seed: int, out: Path | None, *, plots: bool) -> None:
    """Study, keep and tell; what cannot be studied is refused before anything is written."""
    from landsim.runs import new_run
    from landsim.study.folder import write_study
    from landsim.study.plan import plan_of
    from landsim.study.run import run_study
    from landsim.tables import study_tables

    plan_of(scenario)
    with new_run(scenario.name, out) as place:
        with progress_bar(f"{scenario.name}, seed {seed}") as progress:
            result = run_study(scenario, seed, progress)
        write_study(place.temporary, scenario, result.verdict, result.envelopes, result.listed, result.rows)
        if plots:
            with status("drawing"):
                _draw_study(place.temporary, scenario, result.envelopes, result.verdict)
        names = sorted(path.name for path in place.temporary.iterdir())
    with printing(f"{shown(place.final)}: the study is there"):
        click.echo(shown(place.final))
        print_tables(lambda width: study_tables(result.verdict, width))
        click.echo(f"studied in {result.verdict['wall_time_s']:.1f} s; written:")
        _echo_paths(place.final, names)


def _draw_study(
    folder: Path, scenario: "Scenario", envelopes: "Sequence[Envelope]", verdict: dict[str, Any]
) -> list[Path]:
    from landsim.errors import RunFolderError
    from landsim.report import draw_study

    try:
        return draw_study(folder, scenario, envelopes, verdict)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None


def _budget(scenario: "Scenario", order: "Order", figure: Path | None, out: Path | None, *, as_text: bool) -> None:
    """Work out, keep and tell; what cannot be written is refused before anything is worked out."""
    from contextlib import ExitStack

    from landsim.budget import as_dict, make_budget, steps
    from landsim.budget.order import FIGURES, JSON_FILE, check_figure, to_text
    from landsim.plain import as_json
    from landsim.runs import new_run
    from landsim.tables import budget_tables

    if figure is not None:
        check_figure(figure)
    with ExitStack() as stack:
        place = None if out is None else stack.enter_context(new_run(scenario.name, out))
        with progress_bar(f"budget of {scenario.name}") as progress:
            done = itertools.count(1)
            made = make_budget(scenario, order, lambda what: progress and progress(next(done), steps(order), what))
        result = as_json(as_dict(made))
        paths = [] if figure is None else [figure]
        if place is not None:
            _write(place.temporary / JSON_FILE, to_text(result))
            paths += [place.temporary / name for name in FIGURES]
        if paths:
            _draw_budget(result, paths)
    written = [*([] if figure is None else [figure]), *([] if place is None else [place.final])]
    with printing("; ".join(f"{shown(path)}: the budget is there" for path in written)):
        if as_text:
            click.echo(to_text(result), nl=False)
            return
        print_tables(lambda width: budget_tables(result, width))
        for path in written:
            click.echo(shown(path))
        if place is not None:
            _echo_paths(place.final, [JSON_FILE, *FIGURES])


def _write(path: Path, text: str) -> None:
    from landsim.errors import RunFolderError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror}") from None


def _draw_budget(result: dict[str, Any], paths: list[Path]) -> None:
    from landsim.errors import RunFolderError
    from landsim.plots.budget import save_budget

    try:
        with status("drawing"):
            save_budget(result, paths)
    except OSError as error:
        raise RunFolderError(f"{error.filename or paths[0]}: cannot be written: {error.strerror}") from None


def _echo_paths(folder: Path, names: list[str]) -> None:
    for name in names:
        click.echo(f"  {shown(folder / name)}")


if __name__ == "__main__":
    main()
