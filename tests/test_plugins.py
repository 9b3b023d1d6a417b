"""Estimators and controllers of others: what flies, what is refused before a flight, and what ends one."""

import dataclasses
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plug_ins import install, install_trouble

import landsim
from landsim.batch.row import flight_row
from landsim.config import Scenario, ScenarioError
from landsim.errors import InputError
from landsim.log import AXES, QUANTITIES
from landsim.onboard import must_have_plug_ins, on_board
from landsim.plain import as_json
from landsim.plugins import loading, versions_of

HEAD = "import numpy as np\nfrom landsim.plugins import *\n"
WRAPPED = f"""{HEAD}
class Mine:
    def __init__(self, setup):
        self.ours = landsim_estimator(setup)
    def __getattr__(self, name):
        return getattr(self.ours, name)
"""
SHORT = {"simulation.time_limit_s": 1.0, "start.cross_sigma_m": 0.0}
"""A second: thirty frames, of which the filter starts with the fifteenth."""

Install = Callable[..., None]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Installs a package for this process and this test alone: the module's source, then the entry points."""
    modules: list[str] = []
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))

    def add(source: str, module: str = "mine_landsim", **named: Any) -> None:
        modules.append(module)
        install(folder, module, source, **named)
        forget()

    def forget() -> None:
        for module in modules:
            sys.modules.pop(module, None)
        for cached in (loading._entry, loading._factory, loading._version):
            cached.cache_clear()

    yield add
    forget()


def scenario_of(**plug_ins: Any) -> Scenario:
    """A second of the landing with these keys of [plug-ins]."""
    return landsim.load_scenario("landing", SHORT | {f"plug-ins.{key}": value for key, value in plug_ins.items()})


def with_estimator(**plug_ins: Any) -> Scenario:
    return scenario_of(estimator="mine", **plug_ins)


def differing(one: dict[str, Any], other: dict[str, Any], but: tuple[str, ...] = ()) -> list[str]:
    """The columns of two logs that differ."""
    return [name for name in one if name not in but and not np.array_equal(one[name], other[name], equal_nan=True)]


def refusal(scenario: Scenario) -> str:
    with pytest.raises(InputError) as caught:
        must_have_plug_ins(scenario)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert line.startswith(f"{scenario.path}: plug-ins.")
    return line.removeprefix(f"{scenario.path}: plug-ins.")


class TestFlies:
    def test_our_own_as_a_plug_in_flies_the_same_bits(self, installed: Install) -> None:
        """Through every check of what a plug-in returns, to the last column of the log."""
        steers = "def steers(setup):\n    return landsim_controller(setup)\n"
        installed(WRAPPED + steers, estimators={"mine": "Mine"}, controllers={"mine": "steers"})
        ours = landsim.fly(landsim.load_scenario("landing"), seed=3)
        named = {"plug-ins.estimator": "mine", "plug-ins.controller": "mine"}
        theirs = landsim.fly(landsim.load_scenario("landing", named), seed=3)
        assert differing(ours.log, theirs.log) == []
        of_the_machine = {"wall_time_s", "versions"}
        assert {k: v for k, v in ours.metrics.items() if k not in of_the_machine} == {
            k: v for k, v in theirs.metrics.items() if k not in of_the_machine
        }

    def test_it_cannot_write_into_what_is_logged_or_flown(self, installed: Install) -> None:
        wipes = """
    def propagate(self, sample):
        self.ours.propagate(sample.copy())
        sample[:] = 1e9
    def observe(self, frame):
        result = self.ours.observe(frame._replace(lines=frame.lines.copy()))
        frame.lines[:] = 1e9
        return result
"""
        installed(WRAPPED + wipes, estimators={"mine": "Mine"})
        assert differing(landsim.fly(scenario_of()).log, landsim.fly(with_estimator()).log) == []

    def test_what_needs_a_covariance_is_missing_without_one(self, installed: Install) -> None:
        installed(WRAPPED + "    covariance = bias = None\n", estimators={"mine": "Mine"})
        ours, theirs = landsim.fly(scenario_of()), landsim.fly(with_estimator())
        gone = {"nees9", "nees15"} | {f"sigma_{q}" for q in QUANTITIES}
        gone |= {f"sigma_velocity_{axis}_mps" for axis in AXES}
        for axis in AXES:
            gone |= {f"{of}_gyro_bias_{axis}_deg_h" for of in ("true", "fused", "sigma")}
            gone |= {f"{of}_accel_bias_{axis}_mps2" for of in ("true", "fused", "sigma")}
        assert set(differing(ours.log, theirs.log)) == gone
        assert all(np.isnan(theirs.log[name]).all() for name in gone)
        early = theirs.metrics["consistency"]["early"]
        assert (early["nees9_mean"], early["nees15_mean"], early["frames"]) == (None, None, 0)
        assert set(theirs.metrics["coverage"].values()) == {0, None}
        text = json.dumps(as_json(theirs.metrics), allow_nan=False)
        assert "NaN" not in text

    def test_a_covariance_without_biases_gives_all_but_theirs(self, installed: Install) -> None:
        nine = """
    bias = None
    @property
    def covariance(self):
        return None if self.ours.covariance is None else self.ours.covariance[:9, :9]
"""
        installed(WRAPPED + nine, estimators={"mine": "Mine"})
        ours, theirs = landsim.fly(scenario_of()).log, landsim.fly(with_estimator()).log
        there = np.isfinite(ours["nees9"])
        assert there.sum() > 10
        # the leading block of a Cholesky factor is that of the leading block
        assert theirs["nees9"][there] == pytest.approx(ours["nees9"][there], rel=1e-9)
        assert np.isnan(theirs["nees15"]).all()
        for quantity in QUANTITIES:
            assert theirs[f"sigma_{quantity}"] == pytest.approx(ours[f"sigma_{quantity}"], rel=1e-12, nan_ok=True)
        assert np.isnan(theirs["sigma_gyro_bias_x_deg_h"]).all()

    def test_a_frame_that_it_tells_nothing_of_is_logged_by_its_lines(self, installed: Install) -> None:
        silent = "    def observe(self, frame):\n        self.ours.observe(frame)\n"
        installed(WRAPPED + silent, estimators={"mine": "Mine"})
        settings = SHORT | {"simulation.time_limit_s": 40.0, "simulation.end": "touchdown"}
        ours = landsim.fly(landsim.load_scenario("landing", settings)).log
        theirs = landsim.fly(landsim.load_scenario("landing", settings | {"plug-ins.estimator": "mine"})).log
        assert {4.0, 6.0} <= set(ours["nis_dof"])
        assert set(differing(ours, theirs)) <= {"nis", "accepted", *(f"vision_{q}" for q in QUANTITIES)}
        assert np.isnan(theirs["nis"]).all()
        for quantity in QUANTITIES:  # late poses borrow the roll from a step before the filter's own prediction
            vision = theirs[f"vision_{quantity}"]
            assert vision == pytest.approx(ours[f"vision_{quantity}"], abs=1e-6, nan_ok=True)

    def test_numbers_may_come_as_arrays(self, installed: Install) -> None:
        arrays = """
    def state(self, time):
        s = self.ours.state(time)
        R = np.reshape(s.R_runway_from_body, (3, 3))
        return s._replace(position=np.array(s.position), R_runway_from_body=R, rate=list(s.rate), ready=np.True_)
"""
        installed(WRAPPED + arrays.replace("ready=np.True_", "ready=np.bool_(s.ready)"), estimators={"mine": "Mine"})
        assert differing(landsim.fly(scenario_of()).log, landsim.fly(with_estimator()).log) == []

    def test_one_that_is_never_ready_leaves_the_aircraft_in_trim(self, installed: Install) -> None:
        never = """
    def state(self, time):
        return not_ready(time, self.ours.airspeed)
"""
        installed(WRAPPED + never, estimators={"mine": "Mine"})
        flight = landsim.fly(with_estimator())
        assert flight.metrics["outcome"] == "timeout"
        assert (flight.log["phase"] == 0.0).all()
        assert np.isnan(flight.log["fused_along_m"]).all()

    def test_its_reason_for_divergence_ends_the_flight(self, installed: Install) -> None:
        gives_up = """
    @property
    def diverged(self):
        return "it is lost" if self.ours.covariance is not None else None
"""
        installed(WRAPPED + gives_up, estimators={"mine": "Mine"})
        metrics = landsim.fly(with_estimator()).metrics
        assert (metrics["outcome"], metrics["reason"]) == ("diverged", "the navigation filter diverged: it is lost")

    def test_random_numbers_come_from_the_seed(self, installed: Install) -> None:
        installed(WRAPPED, estimators={"mine": "Mine"})
        scenario = with_estimator()
        draws = [setup.rng.standard_normal(4).tolist() for seed in (0, 0, 1) for setup in on_board(scenario, seed)]
        assert draws[:2] == draws[2:4]
        assert len({tuple(draw) for draw in draws}) == 4

    def test_it_is_told_what_is_believed(self, installed: Install) -> None:
        hidden = {"runway.width_error_m": 0.5, "camera.focal_length_error": 0.01, "camera.tilt_error_deg": 0.2}
        plain, _ = on_board(landsim.load_scenario("landing"), 0)
        estimator, controller = on_board(landsim.load_scenario("landing", hidden), 0)
        assert estimator.runway_width == controller.runway_width == 30.5
        differing = {
            field.name
            for field in dataclasses.fields(plain)
            if field.name != "rng" and getattr(plain, field.name) != getattr(estimator, field.name)
        }
        assert differing == {"runway_width"}

    def test_settings_are_handed_over(self, installed: Install) -> None:
        refuses = f"""{HEAD}
def make(setup):
    raise ValueError(f"got {{setup.settings}}")
"""
        installed(refuses, estimators={"mine": "make"}, controllers={"mine": "make"})
        settings = {"gain": 0.5, "names": ["a", "b"], "deep": {"on": True}}
        told = refusal(with_estimator(estimator_settings=settings))
        assert told == f'estimator: estimator "mine": start: ValueError: got {settings}'
        told = refusal(scenario_of(controller="mine", controller_settings={"k": 1}))
        assert told == "controller: controller \"mine\": start: ValueError: got {'k': 1}"


class TestRefused:
    def test_a_name_that_is_not_installed(self, installed: Install) -> None:
        installed(WRAPPED, estimators={"vision-only": "Mine", "mine": "Mine"})
        told = refusal(scenario_of(estimator="vision-olny"))
        start = 'estimator: no estimator "vision-olny" is installed (entry points of landsim.estimators)'
        assert told == f"{start}; did you mean vision-only? (installed: landsim, mine, vision-only)"
        told = refusal(scenario_of(controller="qqq"))
        start = 'controller: no controller "qqq" is installed (entry points of landsim.controllers)'
        assert told == f"{start}; known: landsim"

    def test_a_name_of_two_packages(self, installed: Install) -> None:
        installed(WRAPPED, "one_landsim", estimators={"mine": "Mine"})
        installed(WRAPPED, "two_landsim", estimators={"mine": "Mine"}, version="2.0")
        told = refusal(with_estimator())
        assert told.startswith('estimator: estimator "mine" is offered by several packages: ')
        assert {"one_landsim 1.0", "two_landsim 2.0"} == set(told.rpartition(": ")[2].split(", "))

    @pytest.mark.parametrize(
        ("source", "told"),
        [
            ("import no_such_module\n", "does not import: ModuleNotFoundError: No module named 'no_such_module'"),
            ("def broken(:\n", "does not import: SyntaxError: invalid syntax (mine_landsim.py, line 1)"),
            ("Other = 1\n", "does not import: AttributeError: module 'mine_landsim' has no attribute 'Mine'"),
            ("raise SystemExit(1)\n", "does not import: SystemExit: 1"),
        ],
    )
    def test_one_that_does_not_import(self, installed: Install, source: str, told: str) -> None:
        installed(source, estimators={"mine": "Mine"})
        assert refusal(with_estimator()) == f'estimator: estimator "mine" of mine_landsim 1.0 {told}'

    @pytest.mark.parametrize(
        ("source", "told"),
        [
            ("Mine = 1\n", ": mine_landsim:Mine is not a class or function that takes a EstimatorSetup"),
            ("class Mine:\n    pass\n", ": start: TypeError: Mine() takes no arguments"),
            (WRAPPED + "    observe = None\n", ": Mine has no method observe"),
            (
                WRAPPED + "    def state(self):\n        pass\n",
                ": state must take 1 argument beside self, as landsim.plugins.Estimator says",
            ),
        ],
    )
    def test_one_that_is_no_estimator(self, installed: Install, source: str, told: str) -> None:
        installed(source, estimators={"mine": "Mine"})
        assert refusal(with_estimator()) == f'estimator: estimator "mine"{told}'

    @pytest.mark.parametrize(
        ("key", "value", "told"),
        [
            ("estimator", "", "estimator"),
            ("estimators", "mine", "plug-ins.estimators: unknown key; did you mean plug-ins.estimator?"),
            ("estimator_settings", {"a": [1.0, float("nan")]}, "plug-ins.estimator_settings.a.1: must be a finite"),
            (
                "controller_settings",
                {"gain": 1.0},
                'controller_settings: belongs to a plug-in; with controller = "land',
            ),
        ],
    )
    def test_keys(self, key: str, value: object, told: str) -> None:
        overrides = {"plug-ins.estimator": "mine"} | {f"plug-ins.{key}": value}
        with pytest.raises(ScenarioError) as caught:
            landsim.load_scenario("landing", overrides)
        assert told in str(caught.value)

    def test_our_own_needs_no_package(self) -> None:
        must_have_plug_ins(scenario_of())


STATES = {
    "return None": "state: must return a NavState, not None",
    "return s._replace(position=(0.0, float('nan'), 0.0))": "state: position is not finite: (0.0, nan, 0.0)",
    "return s._replace(velocity=(0.0, 0.0))": "state: velocity must be 3 numbers, not (0.0, 0.0)",
    "return s._replace(rate='fast')": "state: rate must be 3 numbers, not 'fast'",
    "return s._replace(airspeed=None)": "state: airspeed must be a number, not None",
    "return s._replace(R_runway_from_body=np.zeros((3, 3)))": "state: R_runway_from_body is not a rotation",
    "return s._replace(R_runway_from_body=np.diag((1.0, 1.0, -1.0)))": "state: R_runway_from_body is not a rotation",
    "return s._replace(roll=s.roll + 0.1)": "state: roll, pitch and yaw are not those of R_runway_from_body",
    "return s._replace(stage='early')": "state: stage must be a Stage, not 'early'",
    "return {}['key']": "state: KeyError: 'key'",
    "raise SystemExit(2)": "state: SystemExit: 2",
    "assert False": "state: AssertionError",
}
COMMANDS = {
    "return c": "guide: must return a Command and a Phase, not Command(",
    "return c, 'flare'": "guide: must return a Phase with the command, not 'flare'",
    "return c._replace(pitch=float('nan')), p": "guide: pitch is not finite: nan",
    "return c._replace(steering=1.5), p": "guide: steering must be from -1 to 1, not 1.5",
    "return c._replace(brake=-0.1), p": "guide: brake must be from 0 to 1, not -0.1",
    "return c._replace(roll=(1.0, 2.0)), p": "guide: roll must be a number, not (1.0, 2.0)",
    "1 / 0": "guide: ZeroDivisionError: division by zero",
}


class TestEndsTheFlight:
    def ended(self, scenario: Scenario, told: str) -> dict[str, Any]:
        metrics = landsim.fly(scenario).metrics
        assert metrics["outcome"] == metrics["end"] == "error"
        assert metrics["reason"].startswith(told)
        assert len(metrics["reason"].splitlines()) == 1
        return metrics

    @pytest.mark.parametrize(("does", "told"), STATES.items())
    def test_a_state_that_cannot_be_used(self, installed: Install, does: str, told: str) -> None:
        state = f"""
    def state(self, time):
        s = self.ours.state(time)
        if not s.ready:
            return s
        {does}
"""
        installed(WRAPPED + state, estimators={"mine": "Mine"})
        metrics = self.ended(with_estimator(), f'estimator "mine": {told}')
        assert metrics["flight_time_s"] > 0.4
        raised = "Error" in told or "Exit" in told
        assert (metrics["traceback"] is not None) == raised
        if raised:
            assert f"in state: {does}" in metrics["traceback"]

    @pytest.mark.parametrize(("does", "told"), COMMANDS.items())
    def test_a_command_that_cannot_be_used(self, installed: Install, does: str, told: str) -> None:
        steers = f"""{HEAD}
class Mine:
    def __init__(self, setup):
        self.ours = landsim_controller(setup)
    def guide(self, nav):
        c, p = self.ours.guide(nav)
        if p is Phase.ACQUIRE:
            return c, p
        {does}
"""
        installed(steers, controllers={"mine": "Mine"})
        metrics = self.ended(scenario_of(controller="mine"), f'controller "mine": {told}')
        assert metrics["flight_time_s"] > 0.4

    @pytest.mark.parametrize(
        ("attribute", "told"),
        [
            ("covariance = np.eye(4)", "covariance: must be 9 by 9 numbers, not array([[1."),
            ("covariance = np.full((15, 15), np.nan)", "covariance: is not finite: array([[nan, nan"),
            ("bias = (0.0, 0.0)", "bias: must be 6 numbers, not (0.0, 0.0)"),
            ("def observe(self, frame):\n        return 1", "observe: must return a FrameResult or None, not 1"),
            ("diverged = property(lambda self: 1 / 0)", "diverged: ZeroDivisionError: division by zero"),
        ],
    )
    def test_an_attribute_that_cannot_be_used(self, installed: Install, attribute: str, told: str) -> None:
        installed(f"{WRAPPED}    {attribute}\n", estimators={"mine": "Mine"})
        self.ended(with_estimator(), f'estimator "mine": {told}')

    def test_a_state_that_fails_between_frames_leaves_every_step_before(self, installed: Install) -> None:
        state = """
    def state(self, time):
        if time > 0.755:  # frames are at 0.733 and 0.767 s, steps 0.0083 s apart
            raise RuntimeError(f"{time:.3f}")
        return self.ours.state(time)
"""
        installed(WRAPPED + state, estimators={"mine": "Mine"})
        self.ended(with_estimator(), 'estimator "mine": state: RuntimeError: 0.758')
        ours, theirs = landsim.fly(scenario_of()).log, landsim.fly(with_estimator()).log
        steps = theirs["time_s"].size
        assert theirs["time_s"][-1] == pytest.approx(0.75)
        assert differing({name: column[:steps] for name, column in ours.items()}, theirs) == []

    def test_a_constructor_that_raises_for_a_drawn_value(self, installed: Install) -> None:
        """The scenario itself passed; of a batch, one flight alone is lost."""
        picky = f"""{HEAD}
def make(setup):
    if setup.runway_width > 30.0:
        raise ValueError("too wide")
    return landsim_estimator(setup)
"""
        installed(picky, estimators={"mine": "make"})
        must_have_plug_ins(with_estimator())
        wide = landsim.load_scenario("landing", SHORT | {"plug-ins.estimator": "mine", "runway.width_m": 31.0})
        self.ended(wide, 'estimator "mine": start: ValueError: too wide')

    def test_a_row_has_the_traceback(self, tmp_path: Path, installed: Install) -> None:
        install_trouble(tmp_path / "site")
        settings = {"how": "raise", "time_s": 0.7, "seed": 4}
        scenario = scenario_of(estimator="trouble", estimator_settings=settings)
        assert flight_row(scenario, 3)["outcome"] == "timeout"
        row = flight_row(scenario, 4)
        assert (row["outcome"], row["end"]) == ("error", "error")
        assert row["reason"] == 'estimator "trouble": observe: RuntimeError: trouble at 0.7 s'
        assert "landsim_trouble.py:" in row["traceback"]
        assert row["traceback"].endswith("RuntimeError: trouble at 0.7 s")


def test_versions_tell_package_version_and_source(installed: Install) -> None:
    installed(WRAPPED, estimators={"mine": "Mine"})
    scenario = with_estimator()
    first = versions_of(scenario)
    assert first["estimator mine"].startswith("mine_landsim 1.0, source ")
    assert landsim.fly(scenario).metrics["versions"] == first
    assert set(versions_of(scenario_of())) == set(first) - {"estimator mine"}
    installed(WRAPPED + "# edited\n", estimators={"mine": "Mine"})
    assert versions_of(scenario)["estimator mine"] != first["estimator mine"]
    assert versions_of(scenario)["estimator mine"].startswith("mine_landsim 1.0, source ")


def landsim_command(site: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, with the packages of a folder."""
    return subprocess.run(
        [sys.executable, "-m", "landsim", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join((str(site), str(Path(landsim.__file__).parents[1])))},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_command_line_refuses_before_anything_flies(tmp_path: Path) -> None:
    site = install(tmp_path / "site", "mine_landsim", "import no_such_module\n", {"mine": "Mine"})
    work = tmp_path / "work"
    work.mkdir()
    for command in ("check", "run"):
        done = landsim_command(site, work, command, "landing", "--set", "plug-ins.estimator=mine")
        assert (done.returncode, done.stdout) == (2, "")
        assert len(done.stderr.splitlines()) == 1
        assert "does not import: ModuleNotFoundError" in done.stderr
    assert list(work.iterdir()) == []


def test_trouble_in_flight_is_an_outcome_and_no_traceback_on_the_terminal(tmp_path: Path) -> None:
    site = install_trouble(tmp_path / "site")
    settings = ["plug-ins.estimator=trouble", "plug-ins.estimator_settings.how=raise", "simulation.time_limit_s=1.0"]
    flags = [part for setting in settings for part in ("--set", setting)]
    done = landsim_command(site, tmp_path, "run", "landing", *flags, "--no-plots", "--out", "flown")
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert "landsim_trouble.py" not in done.stdout + done.stderr
    metrics = json.loads((tmp_path / "flown" / "metrics.json").read_text())
    assert metrics["outcome"] == "error"
    assert metrics["reason"] == 'estimator "trouble": observe: RuntimeError: trouble at 0.0 s'
    assert "landsim_trouble.py:" in metrics["traceback"]
