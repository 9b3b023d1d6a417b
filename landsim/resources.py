"""Finds the shipped aircraft and scenarios, in a checkout and in an installed wheel; a user's path wins over a name.

A wheel carries both folders in ``landsim/_data``.  A checkout, and so an editable install, has them at its root.
JSBSim wants real paths, so nothing is read out of an archive.
"""

from pathlib import Path

from landsim.errors import ScenarioError, did_you_mean

AIRCRAFT_FILE = "aircraft.toml"


def data_root(package: Path | None = None) -> Path:
    """The folder that holds ``aircraft`` and ``scenarios``.

    Parameters
    ----------
    package : Path, optional
        Folder of the landsim package; this one's by default.
    """
    package = Path(__file__).resolve().parent if package is None else package
    installed = package / "_data"
    return installed if installed.is_dir() else package.parent


def shipped_scenarios() -> dict[str, Path]:
    """The shipped scenario files by name, in alphabetical order."""
    return {path.stem: path for path in sorted((data_root() / "scenarios").glob("*.toml"))}


def shipped_aircraft() -> dict[str, Path]:
    """The shipped aircraft folders by name, in alphabetical order."""
    return {path.parent.name: path.parent for path in sorted((data_root() / "aircraft").glob(f"*/{AIRCRAFT_FILE}"))}


def first_line(path: Path) -> str:
    """What a shipped file says about itself: its first line, without the comment sign."""
    with path.open(encoding="utf-8") as file:
        return file.readline().lstrip("#").strip()


def _looks_like_a_path(name: str) -> bool:
    return "/" in name or "\\" in name or name.endswith(".toml") or name.startswith(("~", "."))


def find_scenario(name_or_path: str | Path) -> Path:
    """The file of a scenario, absolute.

    Parameters
    ----------
    name_or_path : str or Path
        A file, relative to the working directory, or the name of a shipped scenario.

    Raises
    ------
    ScenarioError
        If there is neither.
    """
    name = str(name_or_path)
    path = Path(name).expanduser()
    if path.is_file():
        return path.resolve()
    shipped = shipped_scenarios()
    if name in shipped:
        return shipped[name]
    if path.is_dir():
        raise ScenarioError(f"{name}: is a folder; a scenario is a TOML file")
    if _looks_like_a_path(name):
        raise ScenarioError(f"{name}: no such scenario file")
    raise ScenarioError(f'no scenario "{name}": neither a file nor a shipped name{did_you_mean(name, list(shipped))}')


def find_aircraft(name_or_path: str | Path, base: Path | None = None) -> tuple[str, Path]:
    """The folder of an aircraft.

    Parameters
    ----------
    name_or_path : str or Path
        A folder that holds ``aircraft.toml``, or the name of a shipped aircraft.
    base : Path, optional
        What a relative path is relative to; the working directory by default.

    Returns
    -------
    (str, Path)
        What names the aircraft from anywhere (the shipped name, or an absolute path), and its absolute folder.

    Raises
    ------
    ScenarioError
        If there is neither.
    """
    name = str(name_or_path)
    path = (base or Path()) / Path(name).expanduser()
    if (path / AIRCRAFT_FILE).is_file() and name:
        folder = path.resolve()
        return str(folder), folder
    shipped = shipped_aircraft()
    if name in shipped:
        return name, shipped[name]
    if _looks_like_a_path(name):
        raise ScenarioError(f'no aircraft "{name}": {path / AIRCRAFT_FILE} does not exist')
    raise ScenarioError(f'no aircraft "{name}": neither a folder nor a shipped name{did_you_mean(name, list(shipped))}')
