"""The budget: what the image lines must be worth."""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from landsim.cli.common import echo_paths, overrides, refuse_batch, seed_of, set_option, write_text
from landsim.terminal import print_tables, printing, progress_bar, shown, status

if TYPE_CHECKING:
    from landsim.budget.result import Order
    from landsim.config import Scenario


@click.command()
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
@click.option("--seed", metavar="N", callback=seed_of, help="Of the draws.  [default: 0]")
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

    refuse_batch(scenario)
    loaded, _ = load_flight(scenario, overrides(settings))
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
            write_text(place.temporary / JSON_FILE, to_text(result))
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
            echo_paths(place.final, [JSON_FILE, *FIGURES])


def _draw_budget(result: dict[str, Any], paths: list[Path]) -> None:
    from landsim.errors import RunFolderError
    from landsim.plots.budget import save_budget

    try:
        with status("drawing"):
            save_budget(result, paths)
    except OSError as error:
        raise RunFolderError(f"{error.filename or paths[0]}: cannot be written: {error.strerror}") from None
