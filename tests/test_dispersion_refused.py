"""[dispersions] in a scenario: what is refused, where and in which words."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from landsim.config import ScenarioError, load_scenario, parse_setting, resolved_toml

NORMAL = {"key": "camera.focal_length_error", "distribution": "normal", "mean": 0.0, "sigma": 0.001}
UNIFORM = {"key": "wind.head_mps", "distribution": "uniform", "low": 0.0, "high": 2.0}
DISCRETE = {"key": "camera.rate_hz", "distribution": "discrete", "values": [15.0, 30.0]}
PAIR = {"keys": ["camera.focal_length_error", "wind.head_mps"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}


def refusal(table: Any, name: str = "landing", others: Mapping[str, object] = MappingProxyType({})) -> str:
    """The one line with which dispersions are refused, less file and "override"."""
    with pytest.raises(ScenarioError) as caught:
        load_scenario(name, {**others, "dispersions": table})
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    path, _, told = line.partition(": override ")
    assert Path(path).name == f"{name}.toml"
    return told


DRAWS: list[tuple[dict[str, Any], str]] = [
    ({"sigma": -1.0}, "sigma (camera.focal_length_error): must be above 0, not -1.0"),
    ({"sigma": 0.0}, "sigma (camera.focal_length_error): must be above 0, not 0.0"),
    ({"sigma": "1"}, 'sigma (camera.focal_length_error): must be a number, not "1"'),
    ({"mean": float("nan")}, "mean (camera.focal_length_error): must be a finite number, not nan"),
    ({"sgima": 1.0}, "sgima (camera.focal_length_error): unknown key; did you mean dispersions.draw[1].sigma?"),
    ({"low": 0.0}, "low (camera.focal_length_error): belongs to truncated-normal and uniform; normal has mean, sigma"),
    ({"mean": None}, "mean (camera.focal_length_error): is missing, which normal needs"),
    ({"distribution": "gauss"}, 'distribution (camera.focal_length_error): must be "normal", "truncated-normal"'),
    (
        {"apply": "adds"},
        'apply (camera.focal_length_error): must be "replace", "add" or "multiply", not "adds"; did you',
    ),
    ({"apply": "multiply"}, 'apply: camera.focal_length_error is 0 and stays 0 whatever multiplies it; use "add"'),
    ({"mean": 0.9}, "mean: 0.9 is drawn, but camera.focal_length_error must be at most 0.5"),
    (
        {"key": "camera.focal_lenght_mm"},
        'key: there is no key "camera.focal_lenght_mm" to draw; did you mean camera.foc',
    ),
    ({"key": "noise"}, 'key: there is no key "noise" to draw; '),
    ({"key": "camera"}, "key: camera is a section; name one of its keys, such as camera.focal_length_mm"),
    ({"key": "camera.line_noise"}, "key: camera.line_noise is not a number, and only numbers are drawn"),
    ({"key": "camera.outages_s"}, "key: camera.outages_s is not a number, and only numbers are drawn"),
    ({"key": "box.cross_max_m"}, "key: box.cross_max_m cannot be drawn: box judges a landing"),
    ({"key": "kind"}, "key: kind cannot be drawn: kind says what the file is"),
    ({"key": "aircraft.name"}, "key: aircraft.name cannot be drawn: aircraft says what flies"),
    ({"key": "study.draws"}, "key: study.draws cannot be drawn: study belongs to a study"),
    ({"key": "dispersions.sampling"}, "key: dispersions.sampling cannot be drawn: dispersions says what is drawn"),
    ({"key": "plug-ins.estimator"}, "key: plug-ins.estimator cannot be drawn: plug-ins says who steers"),
    ({"key": ""}, 'key: there is no key "" to draw; known: '),
    ({"key": 3}, "key: must be a string, not 3"),
    ({"key": "camera.width_px"}, "distribution: camera.width_px is a whole number: only a discrete distribution gives"),
    ({"key": "imu.rate_hz"}, "distribution: imu.rate_hz must divide other rates, as hardly any number from a range"),
    ({"key": "wind.head_mps"}, "key: wind.head_mps is drawn already, by draw[0]"),
    ({"key": "start.cross_m"}, "key: start.cross_m would be drawn twice: start.cross_sigma_m = 8 spreads it with each"),
    ({"key": "start.height_m", "mean": 60.0}, "key: start.height_m would be drawn twice: start.height_sigma_m = 4"),
    ({"key": "start.heading_deg"}, "key: start.heading_deg would be drawn twice: start.heading_sigma_deg = 2"),
    ({"key": "start.speed_mps", "mean": 40.0}, "key: start.speed_mps would be drawn twice: start.speed_sigma_mps = 1"),
]


@pytest.mark.parametrize(("changes", "told"), DRAWS, ids=[told[:45] for _, told in DRAWS])
def test_a_normal_draw(changes: dict[str, Any], told: str) -> None:
    draw = {name: value for name, value in {**NORMAL, **changes}.items() if value is not None}
    assert refusal({"draw": [UNIFORM, draw]}).startswith(f"dispersions.draw[1].{told}")


OTHERS: list[tuple[dict[str, Any], str]] = [
    ({"distribution": "uniform", "low": 1.0, "high": 1.0}, "high (camera.noise_px): must be above low = 1, not 1"),
    (
        {"distribution": "uniform", "low": -0.1, "high": 1.0},
        "low: -0.1 is drawn, but camera.noise_px must be at least 0",
    ),
    ({"distribution": "uniform", "high": 1.0}, "low (camera.noise_px): is missing, which uniform needs"),
    ({"distribution": "truncated-normal", "mean": 1.0, "sigma": 1.0}, "low (camera.noise_px): is missing; without low"),
    (
        {"distribution": "truncated-normal", "mean": 1.0, "sigma": 1.0, "low": -1.0},
        "low: -1 is drawn, but camera.noise_px must be at least 0",
    ),
    (
        {"distribution": "truncated-normal", "mean": 1.0, "sigma": 0.1, "low": 2.0},
        "low (camera.noise_px): is 10 sigma beyond the mean: next to nothing of the distribution is left; use uniform",
    ),
    (
        {"distribution": "truncated-normal", "mean": 1.0, "sigma": 0.1, "high": 0.2},
        "high (camera.noise_px): is 8 sigma beyond the mean",
    ),
    ({"distribution": "log-normal", "median": -1.0, "sigma_log": 0.1}, "median (camera.noise_px): must be above 0"),
    ({"distribution": "log-normal", "median": 1.0, "sigma_log": -0.1}, "sigma_log (camera.noise_px): must be above 0"),
    ({"distribution": "discrete", "values": []}, "values (camera.noise_px): must have at least one, not none"),
    (
        {"distribution": "discrete", "values": [1.0, 1.0]},
        "values (camera.noise_px): must not repeat any, not [1.0, 1.0]",
    ),
    ({"distribution": "discrete", "values": [1.0, "2"]}, 'values[1] (camera.noise_px): must be a number, not "2"'),
    (
        {"distribution": "discrete", "values": [1.0, -2.0]},
        "values[1]: -2 is drawn, but camera.noise_px must be at least",
    ),
    (
        {"distribution": "discrete", "values": [1.0, 2.0], "weights": [1.0]},
        "weights (camera.noise_px): must be as many as values, 2, not 1",
    ),
    (
        {"distribution": "discrete", "values": [1.0, 2.0], "weights": [1.0, 0.0]},
        "weights[1] (camera.noise_px): must be above 0, not 0.0",
    ),
]


@pytest.mark.parametrize(("parameters", "told"), OTHERS, ids=[told[:45] for _, told in OTHERS])
def test_another_distribution(parameters: dict[str, Any], told: str) -> None:
    told = f"dispersions.draw[0].{told}"
    assert refusal({"draw": [{"key": "camera.noise_px", **parameters}]}).startswith(told)


TAILS: list[tuple[dict[str, Any], str]] = [
    (
        {"distribution": "normal", "mean": 1.0, "sigma": 1.0},
        'sigma: normal draws -5 too, 6 sigma out, but camera.noise_px must be at least 0; use "truncated-normal"',
    ),
    (
        {"distribution": "normal", "apply": "add", "mean": 0.0, "sigma": 1.0},
        "sigma: normal draws -5.5 too, 6 sigma out, but camera.noise_px must be at least 0, not -5.5; use",
    ),
    (
        {"distribution": "truncated-normal", "mean": 1.0, "sigma": 1.0, "high": 2.0},
        "sigma: truncated-normal draws -5 too, 6 sigma out, but camera.noise_px must be at least 0; use",
    ),
    (
        {"key": "camera.noise_factor", "distribution": "log-normal", "median": 1.0, "sigma_log": 1.0},
        "sigma_log: log-normal draws 403.4 too, 6 sigma out, but camera.noise_factor must be at most 100; use",
    ),
    (  # cut 5 sigma above the mean: what is left has its billionth part beyond sqrt(5² + 6²) = 7.81 sigma
        {"key": "camera.noise_factor", "distribution": "truncated-normal", "mean": 0.0, "sigma": 13.0, "low": 65.0},
        "sigma: truncated-normal draws 101.5 too, 7.81 sigma out, but camera.noise_factor must be at most 100; use",
    ),
    (
        {"key": "runway.length_m", "distribution": "normal", "mean": 2000.0, "sigma": 400.0},
        "sigma: normal draws -400 too, 6 sigma out, but runway.length_m must be above 0; use",
    ),
]


@pytest.mark.parametrize(("changes", "told"), TAILS, ids=[told[:35] for _, told in TAILS])
def test_what_a_distribution_without_an_end_draws(changes: dict[str, Any], told: str) -> None:
    draw = {"key": "camera.noise_px", **changes}
    assert refusal({"draw": [draw]}, others={"camera.noise_px": 0.5}).startswith(f"dispersions.draw[0].{told}")


def test_what_next_to_no_flight_draws_is_not_refused() -> None:
    """Zero is 6.25 sigma from the mean, and 1.2e-10 of all numbers lie below it."""
    draw = {"key": "camera.noise_px", "distribution": "normal", "mean": 1.0, "sigma": 0.16}
    assert load_scenario("landing", {"dispersions": {"draw": [draw]}}).dispersions is not None


def test_a_speed_that_is_the_aircraft_s_own_has_nothing_to_add_to() -> None:
    draw = {**NORMAL, "key": "start.speed_mps", "apply": "add"}
    told = 'dispersions.draw[0].apply: start.speed_mps has no value of its own; give it one, or use "replace"'
    assert refusal({"draw": [draw]}, others={"start.speed_sigma_mps": 0.0}) == told


def test_values_of_a_rate_that_divide_no_other() -> None:
    table = {"draw": [{**DISCRETE, "values": [30.0, 50.0]}]}
    told = (
        "dispersions.draw[0].values[1]: 50 is drawn, but camera.rate_hz must divide simulation.rate_hz = 120; 50 does"
    )
    assert refusal(table).startswith(told)


def test_a_value_that_does_not_agree_with_another_key() -> None:
    table = {"draw": [{"key": "runway.length_m", "distribution": "uniform", "low": 100.0, "high": 2000.0}]}
    told = "dispersions.draw[0].low: 100 is drawn, but with runway.length_m = 100, approach.aim_point_m must be below"
    assert refusal(table).startswith(told)


def test_what_spreads_a_start_and_the_start_drawn_both() -> None:
    draws = [
        {"key": "start.cross_m", "distribution": "uniform", "low": -1.0, "high": 1.0},
        {"key": "start.cross_sigma_m", "distribution": "uniform", "low": 1.0, "high": 2.0},
    ]
    told = "dispersions.draw[0].key: start.cross_m would be drawn twice: start.cross_sigma_m, which is drawn too"
    assert refusal({"draw": draws}, others={"start.cross_sigma_m": 0.0}).startswith(told)


CORRELATIONS: list[tuple[dict[str, Any], str]] = [
    ({"keys": ["wind.head_mps", "wind.cross_mps"]}, "keys[1]: wind.cross_mps is not drawn; drawn are camera.focal"),
    ({"keys": ["wind.head_mps", "camera.rate_hz"]}, "keys[1]: camera.rate_hz is discrete: only continuous"),
    ({"keys": ["wind.head_mps", "wind.head_mps"]}, "keys: must not repeat any"),
    ({"keys": ["wind.head_mps"]}, "keys: must have at least 2 elements, not 1"),
    ({"matrix": [[1.0, 0.5]]}, "matrix: must be 2 rows of 2 numbers, as there are keys, not 2"),
    ({"matrix": []}, "matrix: must be 2 rows of 2 numbers, as there are keys, not no"),
    ({"matrix": [[1.0, 0.5], [0.4, 1.0]]}, "matrix[1][0]: must be symmetric: 0.4 here, but 0.5 at [0][1]"),
    ({"matrix": [[1.0, 0.5], [0.5, 0.9]]}, "matrix[1][1]: must have 1 on the diagonal, not 0.9"),
    ({"matrix": [[1.0, 1.5], [1.5, 1.0]]}, "matrix[0][1]: must be at most 1, not 1.5"),
    ({"matrix": [[1.0, 1.0], [1.0, 1.0]]}, "matrix: must be positive definite; its least eigenvalue is"),
    ({"martix": []}, "martix: unknown key; did you mean dispersions.correlation[0].matrix?"),
]


@pytest.mark.parametrize(("changes", "told"), CORRELATIONS, ids=[told[:45] for _, told in CORRELATIONS])
def test_a_correlation(changes: dict[str, Any], told: str) -> None:
    table = {"draw": [NORMAL, UNIFORM, DISCRETE], "correlation": [{**PAIR, **changes}]}
    assert refusal(table).startswith(f"dispersions.correlation[0].{told}")


def test_correlations_that_exclude_each_other() -> None:
    keys = ["camera.focal_length_error", "wind.head_mps", "wind.cross_mps"]
    matrix = [[1.0, 0.9, 0.9], [0.9, 1.0, -0.9], [0.9, -0.9, 1.0]]  # eigenvalues 1.9, 1.9 and -0.8
    draws = [NORMAL, UNIFORM, {**UNIFORM, "key": "wind.cross_mps"}]
    told = "dispersions.correlation[0].matrix: must be positive definite; its least eigenvalue is -0.8: some of the"
    assert refusal({"draw": draws, "correlation": [{"keys": keys, "matrix": matrix}]}).startswith(told)


def test_a_key_in_two_groups() -> None:
    table = {"draw": [NORMAL, UNIFORM], "correlation": [PAIR, PAIR]}
    told = "dispersions.correlation[1].keys[0]: camera.focal_length_error is in correlation[0] already"
    assert refusal(table).startswith(told)


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({}, "dispersions.draw: is missing"),
        ({"draw": []}, "dispersions.draw: must have at least 1 element, not 0"),
        ({"draws": [NORMAL]}, "dispersions.draws: unknown key; did you mean dispersions.draw?"),
        ({"draw": NORMAL}, "dispersions.draw: must be an array, not a table"),
        ({"draw": [3]}, "dispersions.draw[0]: must be a table, not 3"),
        ({"draw": [NORMAL], "sampling": "lhs"}, 'dispersions.sampling: must be "random", "latin-hypercube" or "sobol"'),
        (3, "dispersions: must be a table, not 3"),
    ],
)
def test_the_section(table: Any, told: str) -> None:
    assert refusal(table).startswith(told)


def test_a_study_has_none() -> None:
    assert refusal({"draw": [UNIFORM]}, "paper-flight") == 'dispersions: belongs to kind = "flight"'


@pytest.mark.parametrize(
    ("key", "value", "nominal"),
    [
        ("camera.focal_length_error", 0.01, "0"),
        ("camera.tilt_error_deg", 0.1, "0"),
        ("camera.noise_factor", 2.0, "1"),
        ("runway.width_error_m", 0.1, "0"),
    ],
)
def test_errors_that_the_frames_of_a_study_do_not_have(key: str, value: float, nominal: str) -> None:
    with pytest.raises(ScenarioError, match=rf'{key}: must be {nominal} in a study of method = "sampling": its frames'):
        load_scenario("paper-fig3", {key: value})
    assert load_scenario("paper-flight", {key: value}).kind == "study"


def test_a_runway_that_navigation_would_take_for_none() -> None:
    with pytest.raises(ScenarioError, match=r"runway\.width_error_m: must be above -width_m = -30, not -30"):
        load_scenario("landing", {"runway.width_error_m": -30.0})


def test_settings_reach_into_the_draws() -> None:
    settings = dict(map(parse_setting, ["dispersions.sampling=sobol", "dispersions.draw[1].sigma=0.5"]))
    loaded = load_scenario("dispersed", settings)
    assert loaded.dispersions is not None
    assert (loaded.dispersions.sampling, loaded.dispersions.draw[1].sigma) == ("sobol", 0.5)
    for key, told in (
        ("dispersions.draw[99].sigma", r"override dispersions\.draw\[99\]\.sigma: dispersions\.draw has \d+ elements"),
        ("camera[0].rate_hz", r"override camera\[0\]\.rate_hz: camera is not an array"),
        (
            "dispersions.draw[0].sigma.x",
            r"override dispersions\.draw\[0\]\.sigma\.x: dispersions.draw\[0\]\.sigma is not",
        ),
        ("dispersions.draw[0].sgima", r"override dispersions\.draw\[0\]\.sgima \(start\.cross_m\): unknown key"),
    ):
        with pytest.raises(ScenarioError, match=told):
            load_scenario("dispersed", {key: 1.0})


def test_dispersions_survive_the_way_to_a_file_and_back(tmp_path: Path) -> None:
    scenario = load_scenario("dispersed")
    path = tmp_path / "again.toml"
    path.write_text(resolved_toml(scenario), encoding="utf-8")
    again = load_scenario(path)
    assert again.dispersions == scenario.dispersions
    assert resolved_toml(again) == resolved_toml(scenario)
