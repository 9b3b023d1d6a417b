"""Shipped data are found in a checkout and in an installed package."""

from pathlib import Path

import pytest

from landsim import resources
from landsim.errors import ScenarioError


def test_a_checkout_has_its_data_at_the_root(tmp_path: Path) -> None:
    package = tmp_path / "landsim"
    package.mkdir()
    assert resources.data_root(package) == tmp_path


def test_an_installed_package_has_its_data_inside(tmp_path: Path) -> None:
    package = tmp_path / "landsim"
    (package / "_data").mkdir(parents=True)
    assert resources.data_root(package) == package / "_data"


def test_shipped_names() -> None:
    assert "landing" in resources.shipped_scenarios()
    assert "pioneer" in resources.shipped_aircraft()
    assert (resources.shipped_aircraft()["pioneer"] / "pioneer.xml").is_file()


@pytest.mark.parametrize("path", resources.shipped_scenarios().values(), ids=lambda path: path.stem)
def test_a_scenarios_first_line_says_what_it_shows(path: Path) -> None:
    assert path.read_text(encoding="utf-8").startswith("# ")
    assert len(resources.first_line(path)) > 20


def test_a_folder_without_the_file_does_not_hide_a_shipped_aircraft(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pioneer").mkdir()
    monkeypatch.chdir(tmp_path)
    assert resources.find_aircraft("pioneer") == ("pioneer", resources.shipped_aircraft()["pioneer"])


def test_a_folder_does_not_hide_a_shipped_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "landing").mkdir()
    monkeypatch.chdir(tmp_path)
    assert resources.find_scenario("landing") == resources.shipped_scenarios()["landing"]


def test_an_unknown_aircraft_names_the_nearest() -> None:
    with pytest.raises(ScenarioError, match="did you mean pioneer"):
        resources.find_aircraft("pionneer")
