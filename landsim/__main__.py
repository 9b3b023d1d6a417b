"""``python -m landsim`` is the command line."""

from landsim.cli import main

main()
