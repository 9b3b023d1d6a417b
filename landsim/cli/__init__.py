"""The command line: the only place that parses arguments and prints.

Exit codes: 0, it ran, whatever the landing was and whoever reads of it; 2, bad input or usage, or a place that cannot
be written, told in one line on stderr; 1, a failure of landsim's own; 130, interrupted or terminated, told in a line
as well.  Heavy libraries are imported by the commands that need them.

::

    entry    the group of the commands, and what every one of them begins and ends with
    flight   list, check, run, plot
    budget   budget
    batch    batch, merge
    replay   replay
    compare  compare
    finish   from the flights of a batch to its summary and report
    common   what they share
"""

from landsim.cli.entry import landsim, main

__all__ = ["landsim", "main"]
