"""Batches side by side: compare."""

import os
from pathlib import Path

import click

from landsim.cli.common import echo_paths
from landsim.cli.finish import flights_there, missing_flights
from landsim.terminal import print_tables, printing, shown, status, tell

COMPARE_FILE = "compare.json"


@click.command()
@click.argument("folders", nargs=-1, required=True, metavar="DIR DIR...", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="New folder for the comparison.  [default: runs/NNN-compare, numbered]",
)
@click.option("--no-report", is_flag=True, help="Draw no figures and write no page.")
def compare(folders: tuple[Path, ...], out: Path | None, no_report: bool) -> None:
    """Tell how the batches in two DIRs or more differ: each other with the first, over the seeds that both flew.

    A difference is the other less the first: above zero where the other has more.  Tables are printed; the numbers
    (compare.json), the page (compare.html, compare.md) and the figures go to a new folder, --out, and none to the
    batches' own.
    """
    from landsim.batch.compare import Batch
    from landsim.batch.compare import compare as compared_of
    from landsim.batch.durable import write_json
    from landsim.batch.flights import load_flights
    from landsim.batch.folder import FLIGHTS_FILE, load_batch
    from landsim.errors import RunFolderError
    from landsim.runs import new_run
    from landsim.tables import compare_tables

    _must_differ(folders)
    batches = []
    incomplete = []
    for folder, name in zip(folders, _names(folders), strict=True):
        scenario, identity = load_batch(folder)
        there = flights_there(folder, scenario, identity)
        if there < len(identity.indices()):
            incomplete.append(missing_flights(folder, there, identity))
        batches.append(Batch(name, scenario, load_flights(folder / FLIGHTS_FILE)))
    with new_run("compare", out) as place:
        with status("comparing") as say:
            compared = compared_of(batches)
            try:
                write_json(place.temporary / COMPARE_FILE, compared)
                if not no_report:
                    from landsim.report import write_comparison

                    say("drawing")
                    write_comparison(place.temporary, compared)
            except OSError as error:
                raise RunFolderError(f"{place.final}: cannot be written: {error.strerror}") from None
        names = sorted(path.name for path in place.temporary.iterdir())
    for line in incomplete:
        tell(line)
    with printing(f"{shown(place.final)}: the comparison is there"):
        click.echo(shown(place.final))
        print_tables(lambda width: compare_tables(compared, width))
        click.echo("written:")
        echo_paths(place.final, names)


def _must_differ(folders: tuple[Path, ...]) -> None:
    from landsim.errors import InputError

    places = [os.path.realpath(folder) for folder in folders]
    for i, place in enumerate(places):
        if place in places[:i]:
            raise InputError(f"{folders[i]}: is named twice; a batch is compared with others, not with itself")


def _names(folders: tuple[Path, ...]) -> list[str]:
    """What to call the batches: their folders' names, with as much of what is above as tells them apart."""
    paths = [Path(os.path.realpath(folder)) for folder in folders]
    for parts in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-parts:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]
