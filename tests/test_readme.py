"""What the README says works."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from landsim.cli import landsim

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    return [block for tongue, block in fenced if tongue == language]


def test_python_examples_run() -> None:
    (code,) = blocks("python")
    names: dict[str, object] = {}
    exec(compile(code, "<README>", "exec"), names)
    assert names["pose"].valid  # type: ignore[attr-defined]


def test_commands_are_known() -> None:
    lines = [line for block in blocks("") for line in block.splitlines() if line.startswith("landsim ")]
    assert len(lines) == 26
    for line in lines:
        command, *arguments = shlex.split(line, comments=True)[1:]
        known = landsim.commands[command]
        known.make_context(command, arguments)  # raises what the command line would refuse


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#:]+)\)", README))
def test_links_lead_somewhere(target: str) -> None:
    assert (Path(__file__).resolve().parents[1] / target).exists()


def test_the_help_names_every_command() -> None:
    text = CliRunner().invoke(landsim, ["--help"]).output
    assert all(
        f"  {command}" in text
        for command in ("list", "check", "run", "plot", "budget", "batch", "merge", "replay", "compare")
    )
