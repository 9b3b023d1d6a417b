"""Packages with plug-ins, installed into a folder as pip would, and a plug-in that makes trouble when it is told to."""

from collections.abc import Mapping
from pathlib import Path

TROUBLE = '''
"""Our own estimator and controller, until it is time for trouble."""

import os
import signal
import time

from landsim.plugins import landsim_controller, landsim_estimator


class Trouble:
    """settings: how (raise, exit, hang, kill, nan), time_s (0.0), seed (of the one flight that it is for)."""

    def __init__(self, setup):
        settings = setup.settings
        self._ours = landsim_estimator(setup)
        self._how, self._time = settings.get("how"), settings.get("time_s", 0.0)
        self._meant = settings.get("seed") in (None, setup.rng.bit_generator.seed_seq.entropy)

    def __getattr__(self, name):
        return getattr(self._ours, name)

    def state(self, time_s):
        known = self._ours.state(time_s)
        return known._replace(position=(float("nan"),) * 3) if self._due("nan", time_s) else known

    def observe(self, frame):
        if self._due("raise", frame.time):
            raise RuntimeError(f"trouble at {frame.time:.1f} s")
        if self._due("exit", frame.time):
            raise SystemExit(3)
        while self._due("hang", frame.time):
            time.sleep(0.05)
        if self._due("kill", frame.time):
            os.kill(os.getpid(), signal.SIGKILL)
        return self._ours.observe(frame)

    def _due(self, how, time_s):
        return self._how == how and self._meant and time_s >= self._time


def ours(setup):
    return landsim_controller(setup)
'''


def install(
    folder: Path,
    module: str,
    source: str,
    estimators: Mapping[str, str] | None = None,
    controllers: Mapping[str, str] | None = None,
    version: str = "1.0",
) -> Path:
    """Install a package of one module with entry points into a folder that is, or will be, on the path of Python.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    module : str
        Also the name of the package.
    source : str
        Of the module.
    estimators, controllers : mapping of str to str, optional
        Names of plug-ins, and the objects of the module.
    version : str

    Returns
    -------
    Path
        The folder.
    """
    info = folder / f"{module}-{version}.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (folder / f"{module}.py").write_text(source, encoding="utf-8")
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: {version}\n", encoding="utf-8")
    lines = []
    for group, named in (("landsim.estimators", estimators), ("landsim.controllers", controllers)):
        lines += [f"[{group}]", *(f"{name} = {module}:{value}" for name, value in (named or {}).items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def install_trouble(folder: Path) -> Path:
    """Install the plug-in ``trouble``, an estimator, and ``trouble-controller``, which is our own controller."""
    return install(folder, "landsim_trouble", TROUBLE, {"trouble": "Trouble"}, {"trouble-controller": "ours"})
