"""The page on weather: its commands run, its numbers are those of the report beside it, of the scenario as shipped.

To fly the 2000 flights again takes a quarter of an hour, so they are not: what would change them is held here.
"""

import re
import shlex
from pathlib import Path

import pytest

import landsim
from landsim.cli import landsim as program
from landsim.config import load_scenario, resolved_toml

DOCS = Path(landsim.__file__).parents[1] / "docs"
PAGE = (DOCS / "weather.md").read_text(encoding="utf-8")
REPORT = (DOCS / "weather/report.md").read_text(encoding="utf-8")


def test_the_report_is_of_the_scenario_as_it_is() -> None:
    (flown,) = re.findall(r"^\*scenario\.toml\*\n\n```toml\n(.*?)^```$", REPORT, re.DOTALL | re.MULTILINE)
    assert flown.strip() == resolved_toml(load_scenario("weather")).strip()


def test_commands_are_known() -> None:
    fenced = [line for line in PAGE.splitlines() if line.startswith("landsim ")]
    within = re.findall(r"`(landsim batch [^`]*)`", PAGE)
    assert (len(fenced), len(within)) == (2, 3)
    for line in (*fenced, *within):
        command, *arguments = shlex.split(line)[1:]
        program.commands[command].make_context(command, list(arguments))
        load_scenario(arguments[0], dict(text.split("=") for text in arguments if "=" in text))


@pytest.mark.parametrize("key", re.findall(r"\| `([a-z_.]+=\S+)` \|", PAGE))
def test_single_errors_are_keys(key: str) -> None:
    name, value = key.split("=")
    number: str | float = value if value.isalpha() else float(value)
    load_scenario("landing", {"navigation.aiding": "lines", name: number})


def test_rates_are_those_of_the_report() -> None:
    counts = re.search(r"\*\*(\d+) of 2000 flights landed, .*? (\d+) went around", PAGE)
    assert counts is not None
    landed, around = map(int, counts.groups())
    assert landed + around == 2000
    assert f"**{landed} of 2000 flights landed in the box" in REPORT
    assert f"\n{around} of 2000 went around" in REPORT
    assert "No flight of 2,000 landed outside the box, crashed or left the runway without a flag" in REPORT


@pytest.mark.parametrize(("title", "phase"), [("approach", "early"), ("late stage", "late"), ("rollout", "rollout")])
def test_consistency_is_that_of_the_report(title: str, phase: str) -> None:
    mean = re.search(rf"^\| {title}[^|]*\| \d+ \| ([\d.]+) ±", PAGE, re.MULTILINE)
    told = re.search(rf"^- {phase}, 9 states: mean ([\d.]+) .*?: (\w+) the bounds", REPORT, re.MULTILINE)
    assert mean is not None
    assert told is not None
    assert float(mean[1]) == pytest.approx(float(told[1]), abs=0.006)
    assert told[2] == "within"


def test_quantiles_are_those_of_the_report() -> None:
    for mine, theirs in (("touchdown off the centreline, m", "|lateral touchdown|, m"), ("sink rate, m/s",) * 2):
        cells = re.search(rf"^\| {re.escape(mine)} \| [\d.]+ \| [\d.]+ \| ([\d.]+) \|", PAGE, re.MULTILINE)
        name = re.escape(theirs.replace("|", "\\|"))
        told = re.search(rf"^\| {name} +\| +99 % \| +([\d.]+) \|", REPORT, re.MULTILINE)
        assert cells is not None
        assert told is not None
        assert float(cells[1]) == pytest.approx(float(told[1]), abs=0.006)


@pytest.mark.parametrize(
    "target",
    [*re.findall(r"\]\(([^)#:]+)\)", PAGE), *(f"weather/{name}" for name in re.findall(r"\]\(([^)#:]+)\)", REPORT))],
)
def test_links_lead_somewhere(target: str) -> None:
    assert (DOCS / target).exists()
