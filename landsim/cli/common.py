"""What the commands share: their options, and the scenario that they are given."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from landsim.terminal import shown

if TYPE_CHECKING:
    from landsim.config import Scenario
    from landsim.log import Log

SEED_DIGITS = 1000
BATCH_FILE = "batch.json"
"""As in `landsim.batch.identity`, which is not imported for its name: whoever checks a scenario would wait for it."""

set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a key of the scenario, as --set camera.rate_hz=15.0; may be repeated.",
)


def seed_of(context: click.Context, option: click.Parameter, value: str | None) -> int | None:
    """A whole number, not negative, in decimal digits."""
    if value is None:
        return None
    if not (value.isascii() and value.isdigit() and len(value) <= SEED_DIGITS):
        message = f"must be a whole number, 0 or more, not {value or 'nothing'}"
        raise click.BadParameter(message, context, option)
    return int(value)


def whole(context: click.Context, option: click.Parameter, value: str | None) -> int | None:
    """A whole number, not negative, in decimal digits."""
    return seed_of(context, option, value)


def positive(context: click.Context, option: click.Parameter, value: str | None) -> int | None:
    """A whole number, one or more, in decimal digits."""
    if value is None:
        return None
    if not (value.isascii() and value.isdigit() and len(value) <= SEED_DIGITS and int(value) >= 1):
        raise click.BadParameter(f"must be a whole number, 1 or more, not {value or 'nothing'}", context, option)
    return int(value)


def load(scenario: str, settings: tuple[str, ...]) -> "tuple[Scenario, int | None]":
    """The scenario, its aircraft found to load into JSBSim, and the seed if it is that of a run."""
    from landsim.dispersion import loading_to_offer
    from landsim.errors import InputError
    from landsim.plant import Plant
    from landsim.runs import load_flight
    from landsim.runway import Runway

    try:
        Path.cwd()
    except OSError:  # JSBSim asks for it
        raise InputError("the working directory is not there any more; change to another") from None
    refuse_batch(scenario)
    loaded, seed = load_flight(scenario, overrides(settings))
    aircraft, runway = loaded.aircraft_config, Runway(length=loaded.runway.length_m, width=loaded.runway.width_m)
    Plant(aircraft.folder, aircraft.model, runway, loaded.simulation.rate_hz, loading_to_offer(loaded))
    if loaded.plug_ins.others():
        from landsim.onboard import must_have_plug_ins

        must_have_plug_ins(loaded)
    return loaded, seed


def refuse_batch(scenario: str) -> None:
    """InputError if what should be a scenario is the folder of a batch, which has one but is none."""
    from landsim.errors import InputError
    from landsim.resources import shipped_scenarios

    try:
        batch = scenario not in shipped_scenarios() and (Path(scenario) / BATCH_FILE).is_file()
    except OSError:  # a name too long
        return
    if scenario and batch:
        told = f"is the folder of a batch, not a scenario; did you mean {Path(scenario) / 'scenario.toml'}?"
        raise InputError(f"{scenario}: {told}")


def overrides(settings: tuple[str, ...]) -> dict[str, object]:
    """Keys and values of ``--set``."""
    from landsim.config import parse_setting

    return dict(parse_setting(text) for text in settings)


def write_text(path: Path, text: str) -> None:
    """Write a file; RunFolderError if that cannot be."""
    from landsim.errors import RunFolderError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror}") from None


def echo_paths(folder: Path, names: list[str]) -> None:
    """Print the paths of a folder's files, a line each."""
    for name in names:
        click.echo(f"  {shown(folder / name)}")


def draw(folder: Path, scenario: "Scenario", log: "Log", metrics: dict[str, Any]) -> list[Path]:
    """Draw a run's pictures into its folder; RunFolderError if they cannot be written."""
    from landsim.errors import RunFolderError
    from landsim.report import draw_run

    try:
        return draw_run(folder, scenario, log, metrics)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None
