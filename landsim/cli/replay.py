"""One flight of a batch again: replay."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from landsim.cli.common import draw, echo_paths, whole
from landsim.terminal import EXIT_FAILURE, after, print_tables, printing, shown, status

if TYPE_CHECKING:
    from landsim.batch.replay import Recorded
    from landsim.batch.row import Row

PATIENCE_S = 5.0


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.argument("index", callback=whole)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the run.  [default: runs/NNN-SCENARIO, numbered]",
)
@click.option("--no-plots", is_flag=True, help="Draw no pictures; landsim plot DIR draws them later.")
def replay(folder: Path, index: int, out: Path | None, no_plots: bool) -> None:
    """Fly flight INDEX of the batch in DIR again, and keep its log, metrics and pictures as run does.

    Tells whether it is the same flight, bit for bit; if it is not, the exit code is 1.
    """
    from landsim.batch.job import as_flown
    from landsim.batch.replay import find_flight
    from landsim.batch.replay import replay as flown_again
    from landsim.plain import as_json
    from landsim.runs import new_run, write_run
    from landsim.tables import flight_tables

    recorded = find_flight(folder, index)
    scenario = as_flown(recorded.scenario, recorded.job.draws)
    with new_run(scenario.name, out) as place:
        doing = f"flying flight {index} of {shown(folder)}, seed {recorded.job.seed}"
        with status(doing) as say:
            with after(PATIENCE_S, lambda: say(f"{doing}; a first flight compiles, half a minute")):
                again = flown_again(recorded)
            if again.flight is None:
                raise click.ClickException(f"flight {index} raises: {again.row['reason']}")
            metrics = as_json(again.flight.metrics)
            write_run(place.temporary, scenario, again.flight)
            if not no_plots:
                say("drawing")
                draw(place.temporary, scenario, again.flight.log, metrics)
        names = sorted(path.name for path in place.temporary.iterdir())
    same, told = _compared(recorded, again.row)
    with printing(f"{shown(place.final)}: the run is there"):
        click.echo(shown(place.final))
        click.echo(f"flight {index} of {shown(folder)}, seed {recorded.job.seed}: {told}")
        print_tables(lambda width: flight_tables(metrics, width))
        click.echo("written:")
        echo_paths(place.final, names)
    if not same:
        sys.exit(EXIT_FAILURE)


def _compared(recorded: "Recorded", row: "Row") -> tuple[bool, str]:
    """Whether a flight is the same again, and what there is to say of it."""
    from landsim.batch.identity import differing_version
    from landsim.batch.replay import WALL_TIME, first_difference
    from landsim.versions import versions

    then = recorded.row
    if then["end"] == "error" and row["end"] != "error":
        return True, f"the batch has no flight to compare it with: {then['reason']}"
    name = first_difference(then, row)
    if name is None:
        return True, f"identical in every bit of its {len(row) - 1} columns beside {WALL_TIME}"
    differs = differing_version(recorded.identity.versions, versions())
    why = f"the versions differ: {differs}" if differs else "with the same versions"
    return False, f"NOT identical: {name} was {_brief(then.get(name))} and is {_brief(row.get(name))}; {why}"


def _brief(value: Any) -> str:
    from landsim.errors import one_line, shown

    return one_line(shown(value))
