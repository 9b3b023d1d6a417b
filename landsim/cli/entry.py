"""The group of the commands, and what every one of them begins and ends with."""

import os
import sys
from typing import Any, NoReturn

import click

from landsim import __version__
from landsim.cli import batch, budget, compare, flight, replay
from landsim.terminal import (
    EXIT_BAD_INPUT,
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    fail,
    make_printable,
    printing,
    terminable,
)
from landsim.threads import THREAD_VARIABLES

DEBUG_VARIABLE = "LANDSIM_DEBUG"


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(__version__, prog_name="landsim")
def landsim() -> None:
    """Fly vision-guided landings in JSBSim.

    SCENARIO is the name of a shipped scenario (see: landsim list), the path of a TOML file, or the folder of a run,
    whose scenario it then is; a shipped name wins over a folder (./NAME is the folder).
    """


for _command in (
    flight.list_command,
    flight.check,
    flight.run,
    batch.batch,
    batch.merge,
    replay.replay,
    compare.compare,
    flight.plot,
    budget.budget,
):
    landsim.add_command(_command)


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
