"""The group of the commands, and what every one of them begins and ends with."""

import errno
import os
import sys
from collections.abc import Callable
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

NO_ROOM = {errno.ENOSPC, errno.EFBIG, *({errno.EDQUOT} if hasattr(errno, "EDQUOT") else ())}
"""What a file that cannot be written for want of room is refused with."""
INTERRUPTED = "interrupted"
DEBUG_VARIABLE = "LANDSIM_DEBUG"


class Commands(click.Group):
    """The commands, of which an interrupt ends each as it ends all."""

    def invoke(self, context: click.Context) -> Any:
        """As of any group, but for an interrupt, over which click would print an empty line."""
        try:
            return super().invoke(context)
        except KeyboardInterrupt:
            fail(INTERRUPTED, EXIT_INTERRUPTED)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
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
    make_printable()
    try:
        with terminable() as interrupted:
            code = _run(arguments, interrupted)
    except KeyboardInterrupt:
        fail(INTERRUPTED, EXIT_INTERRUPTED)
    sys.exit(code)


def _run(arguments: list[str] | None, interrupted: Callable[[], bool]) -> int:
    """Run the command line, for its exit code; what goes wrong is told in a line."""
    debug = bool(os.environ.get(DEBUG_VARIABLE))
    try:
        code: Any = landsim.main(arguments, prog_name="landsim", standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "landsim"
        fail(f"{error.format_message()}  See: {where} --help", EXIT_BAD_INPUT)
    except click.ClickException as error:
        fail(error.format_message(), EXIT_BAD_INPUT)
    except click.Abort:  # an interrupt while the arguments are read
        raise KeyboardInterrupt from None
    except Exception as error:
        from landsim.errors import InputError

        if interrupted():  # a library has made another exception of it
            raise KeyboardInterrupt from None
        if debug:
            raise
        if isinstance(error, InputError):
            fail(str(error), EXIT_BAD_INPUT)
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            fail(f"{error.filename or 'a file'}: cannot be written: {error.strerror}", EXIT_BAD_INPUT)
        text = f"{type(error).__name__}: {error}"
        fail(f"{text} (a fault of landsim; {DEBUG_VARIABLE}=1 shows where)", EXIT_FAILURE)
    with printing():  # what click itself printed
        pass
    return code if isinstance(code, int) else 0
