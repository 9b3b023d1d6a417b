"""Single flights and studies: list, check, run and plot."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from landsim.cli.common import draw, echo_paths, load, seed_of, set_option
from landsim.cli.finish import report_again
from landsim.terminal import after, print_tables, printing, progress_bar, shown, status

if TYPE_CHECKING:
    from landsim.config import Scenario
    from landsim.study.model import Envelope

PATIENCE_S = 5.0


@click.command("list")
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


@click.command()
@click.argument("scenario")
@set_option
def check(scenario: str, settings: tuple[str, ...]) -> None:
    """Validate SCENARIO, load its aircraft into JSBSim, and print the scenario with every key.

    What is printed is a TOML file of the same flight, after what each dispersion draws.  Every number outside [box] can
    be drawn; a distribution that may draw what its key must not be is refused.
    """
    from landsim.config import resolved_toml
    from landsim.dispersion import described
    from landsim.errors import one_line

    loaded, _ = load(scenario, settings)
    if loaded.kind == "study":
        from landsim.study.plan import plan_of

        plan_of(loaded)
    with printing():
        click.echo(one_line(f"# {loaded.name}: {loaded.path}; aircraft: {loaded.aircraft_config.title}"))
        for line in described(loaded):
            click.echo(f"# drawn: {line}")
        click.echo(resolved_toml(loaded), nl=False)


@click.command()
@click.argument("scenario")
@click.option(
    "--seed", metavar="N", callback=seed_of, help="Of everything random.  [default: 0, or that of the run named]"
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

    from landsim.dispersion import dispersed, draws_of_seed
    from landsim.plain import as_json
    from landsim.runs import new_run, write_run
    from landsim.tables import flight_tables

    begin = perf_counter()
    loaded, flown_seed = load(scenario, settings)
    if seed is None:
        seed = flown_seed or 0
    if loaded.kind == "study":
        _run_study(loaded, seed, out, plots=not no_plots)
        return
    as_flown = dispersed(loaded, draws_of_seed(loaded, seed))
    with new_run(loaded.name, out) as place:
        doing = f"flying {loaded.name}, seed {seed}"
        with status(doing) as say:
            with after(PATIENCE_S, lambda: say(f"{doing}; a first flight compiles, half a minute")):
                from landsim.simulate import fly

                flight = fly(loaded, seed=seed)
            metrics = as_json(flight.metrics)
            write_run(place.temporary, as_flown, flight)
            if not no_plots:
                say("drawing")
                draw(place.temporary, as_flown, flight.log, metrics)
        names = sorted(path.name for path in place.temporary.iterdir())
    taken = perf_counter() - begin
    with printing(f"{shown(place.final)}: the run is there"):
        click.echo(shown(place.final))  # first, so that who reads no further knows
        print_tables(lambda width: flight_tables(metrics, width))
        click.echo(f"flown in {metrics['wall_time_s']:.2f} s, all in {taken:.1f} s; written:")
        echo_paths(place.final, names)


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def plot(folder: Path) -> None:
    """Draw the pictures of the run or the study, or the report of the batch, in DIR again."""
    from landsim.batch.folder import is_batch
    from landsim.runs import read_run
    from landsim.study.folder import VERDICT_FILE, read_study

    if is_batch(folder):
        with status("summing up") as say:
            paths = report_again(folder, say)
    elif (folder / VERDICT_FILE).is_file():
        study = read_study(folder)
        with status("drawing"):
            paths = _draw_study(folder, study.scenario, study.envelopes, study.verdict)
    else:
        flown = read_run(folder)
        with status("drawing"):
            paths = draw(folder, flown.scenario, flown.log, flown.metrics)
    with printing(f"{shown(folder)}: the pictures are there"):
        echo_paths(folder, sorted(path.name for path in paths))


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
        echo_paths(place.final, names)


def _draw_study(
    folder: Path, scenario: "Scenario", envelopes: "Sequence[Envelope]", verdict: dict[str, Any]
) -> list[Path]:
    from landsim.errors import RunFolderError
    from landsim.report import draw_study

    try:
        return draw_study(folder, scenario, envelopes, verdict)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None
