"""landsim/dispersion.py: distributions against scipy.stats, designs by their defining property, draws that repeat."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from scipy import stats

from landsim.batch import row as batch
from landsim.batch.row import SCALARS, flight_row, scalars_of
from landsim.config import Scenario, ScenarioFile, load_scenario, resolved_toml
from landsim.dispersion import Design, check_draws, described, dispersed, draws_of_seed, keys_of, quantile_of
from landsim.errors import ScenarioError
from landsim.log import COLUMNS
from landsim.resources import shipped_scenarios
from landsim.schema import DrawConfig, drawable
from landsim.simulate import Flight, fly

SHORT = {"start.along_m": -260.0, "start.height_m": 21.2, "simulation.time_limit_s": 2.0}
NO_SPREAD = {
    f"start.{name}": 0.0 for name in ("cross_sigma_m", "height_sigma_m", "heading_sigma_deg", "speed_sigma_mps")
}
CROSS = {"key": "start.cross_m", "distribution": "normal", "mean": 1.0, "sigma": 8.0}
HEAD = {"key": "wind.head_mps", "distribution": "uniform", "low": -1.0, "high": 4.0}
NOISE = {"key": "camera.noise_factor", "distribution": "log-normal", "median": 1.5, "sigma_log": 0.3}
WIDTH = {"key": "runway.width_m", "apply": "add", "distribution": "truncated-normal", "mean": 0.1, "sigma": 0.2}
WIDTH |= {"low": -0.1, "high": 0.6}
RATE = {"key": "camera.rate_hz", "distribution": "discrete", "values": [30.0, 15.0, 10.0], "weights": [2.0, 1.0, 1.0]}
LAW = {
    "start.cross_m": stats.norm(1.0, 8.0),
    "wind.head_mps": stats.uniform(-1.0, 5.0),
    "camera.noise_factor": stats.lognorm(0.3, scale=1.5),
    "runway.width_m": stats.truncnorm(-1.0, 2.5, loc=30.1, scale=0.2),
}


def scenario_of(
    *draws: Mapping[str, Any],
    sampling: str = "random",
    correlation: Sequence[Mapping[str, Any]] = (),
    others: Mapping[str, object] = MappingProxyType({}),
) -> Scenario:
    """The landing with these draws."""
    table = {"sampling": sampling, "draw": list(draws), "correlation": list(correlation)}
    return load_scenario("landing", {**NO_SPREAD, **others, "dispersions": table})


def drawn(scenario: Scenario, n: int, seed: int = 0) -> dict[str, np.ndarray]:
    """The values of a batch, an array a key."""
    design = Design(scenario, seed, n)
    flights = [design.draws(index) for index in range(n)]
    return {key: np.array([flight[key] for flight in flights]) for key in keys_of(scenario)}


# --- distributions ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "law"),
    [
        ({"distribution": "normal", "mean": -2.0, "sigma": 0.5}, stats.norm(-2.0, 0.5)),
        ({"distribution": "uniform", "low": -2.0, "high": 0.5}, stats.uniform(-2.0, 2.5)),
        ({"distribution": "log-normal", "median": 3.0, "sigma_log": 0.4}, stats.lognorm(0.4, scale=3.0)),
        (
            {"distribution": "truncated-normal", "mean": 1.0, "sigma": 2.0, "low": -1.0, "high": 2.0},
            stats.truncnorm(-1.0, 0.5, loc=1.0, scale=2.0),
        ),
        (
            {"distribution": "truncated-normal", "mean": 1.0, "sigma": 2.0, "low": 11.0, "high": 13.0},
            stats.truncnorm(5.0, 6.0, loc=1.0, scale=2.0),
        ),
        (
            {"distribution": "truncated-normal", "mean": 1.0, "sigma": 2.0, "low": 4.0},
            stats.truncnorm(1.5, math.inf, loc=1.0, scale=2.0),
        ),
        (
            {"distribution": "truncated-normal", "mean": 1.0, "sigma": 2.0, "high": -10.0},
            stats.truncnorm(-math.inf, -5.5, loc=1.0, scale=2.0),
        ),
    ],
)
def test_quantiles_are_scipy_s(parameters: dict[str, Any], law: Any) -> None:
    quantile = quantile_of(DrawConfig.model_validate({"key": "any", **parameters}))
    for u in (1e-12, 1e-6, 0.01, 0.3, 0.5, 0.9, 0.999, 1.0 - 1e-9):
        assert quantile(u) == pytest.approx(float(law.ppf(u)), rel=1e-9, abs=1e-9), u


@pytest.mark.parametrize("sampling", ["random", "latin-hypercube", "sobol"])
def test_draws_have_their_distributions(sampling: str) -> None:
    """By the Kolmogorov-Smirnov test; of the values that are picked, by chi squared."""
    values = drawn(scenario_of(CROSS, HEAD, NOISE, WIDTH, RATE, sampling=sampling), 2000)
    for key, law in LAW.items():
        assert stats.kstest(values[key], law.cdf).pvalue > 1e-3, key
    counts = [np.sum(values["camera.rate_hz"] == rate) for rate in (30.0, 15.0, 10.0)]
    assert stats.chisquare(counts, [1000, 500, 500]).pvalue > 1e-3
    independent = np.corrcoef(list(values.values()))
    assert np.abs(independent - np.eye(5)).max() < 4.0 / math.sqrt(2000)


def test_a_drawn_number_replaces_is_added_or_multiplies() -> None:
    values = drawn(scenario_of({**HEAD, "apply": "add"}, others={"wind.head_mps": 7.0}), 400)["wind.head_mps"]
    assert (values.min(), values.max()) == (pytest.approx(6.0, abs=0.1), pytest.approx(11.0, abs=0.1))
    tripled = {"key": "pitot.noise_mps", "apply": "multiply", "distribution": "discrete", "values": [3.0]}
    assert draws_of_seed(scenario_of(tripled), 0) == {"pitot.noise_mps": pytest.approx(0.9)}


def test_a_group_has_its_correlation() -> None:
    """A Gaussian copula's Spearman correlation is 6/π asin(ρ/2), whatever the distributions."""
    rho = np.array([[1.0, -0.7, 0.3], [-0.7, 1.0, 0.2], [0.3, 0.2, 1.0]])
    keys = ["camera.noise_factor", "start.cross_m", "runway.width_m"]
    group = {"keys": keys, "matrix": rho.tolist()}
    values = drawn(scenario_of(CROSS, HEAD, NOISE, WIDTH, correlation=[group]), 3000, seed=4)
    scores = [stats.norm.ppf(LAW[key].cdf(values[key])) for key in keys]
    np.testing.assert_allclose(np.corrcoef(scores), rho, atol=4.0 / math.sqrt(3000))
    ranks = np.array(stats.spearmanr(np.array([values[key] for key in keys]).T).statistic)
    np.testing.assert_allclose(ranks, 6.0 / math.pi * np.arcsin(rho / 2.0), atol=4.0 / math.sqrt(3000))
    for key, law in LAW.items():
        assert stats.kstest(values[key], law.cdf).pvalue > 1e-3, key
    assert abs(np.corrcoef(values["wind.head_mps"], values["start.cross_m"])[0, 1]) < 4.0 / math.sqrt(3000)


# --- designs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 7, 64])
def test_a_latin_hypercube_has_one_flight_in_every_slice(n: int) -> None:
    scenario = scenario_of(CROSS, HEAD, NOISE, WIDTH, sampling="latin-hypercube")
    values = drawn(scenario, n, seed=3)
    for key, law in LAW.items():
        assert sorted(np.floor(n * law.cdf(values[key])).astype(int)) == list(range(n)), key


def test_the_first_key_of_a_group_keeps_its_slices() -> None:
    group = {"keys": ["wind.head_mps", "start.cross_m"], "matrix": [[1.0, 0.8], [0.8, 1.0]]}
    values = drawn(scenario_of(CROSS, HEAD, sampling="latin-hypercube", correlation=[group]), 50)
    slices = np.floor(50 * LAW["wind.head_mps"].cdf(values["wind.head_mps"])).astype(int)
    assert sorted(slices) == list(range(50))


def test_sobol_s_points_are_balanced_and_do_not_depend_on_how_many() -> None:
    """Of a base-2 net's first 2^m points, one lies in each interval of length 2^-m of every axis."""
    scenario = scenario_of(CROSS, HEAD, NOISE, WIDTH, sampling="sobol")
    values = drawn(scenario, 64, seed=5)
    for key, law in LAW.items():
        assert sorted(np.floor(64 * law.cdf(values[key])).astype(int)) == list(range(64)), key
    for n in (1, 3, 65, 100):
        for key, some in drawn(scenario, n, seed=5).items():
            np.testing.assert_array_equal(some[:64], values[key][:n])


@pytest.mark.parametrize("sampling", ["random", "latin-hypercube", "sobol"])
def test_a_flight_s_draws_are_the_same_bits_whoever_asks(sampling: str) -> None:
    scenario = scenario_of(CROSS, HEAD, NOISE, WIDTH, RATE, sampling=sampling)
    whole = [Design(scenario, 11, 40).draws(index) for index in range(40)]
    backwards = Design(scenario, 11, 40)
    assert [backwards.draws(index) for index in reversed(range(40))] == whole[::-1]
    assert len({flight["start.cross_m"] for flight in whole}) == 40
    assert Design(scenario, 12, 40).draws(0) != whole[0]
    for index in (-1, 40):
        with pytest.raises(IndexError, match="no flight"):
            backwards.draws(index)


def test_random_draws_are_those_of_the_flight_s_seed() -> None:
    scenario = scenario_of(CROSS, HEAD)
    assert Design(scenario, 7, 5).draws(3) == draws_of_seed(scenario, 10)
    longer = draws_of_seed(scenario_of(CROSS, HEAD, NOISE), 10)  # what is added at the end moves nothing
    assert {key: longer[key] for key in keys_of(scenario)} == draws_of_seed(scenario, 10)
    huge = 10**40
    assert Design(scenario, huge, 2).draws(1) == draws_of_seed(scenario, huge + 1)


def test_the_dispersions_have_random_numbers_of_their_own() -> None:
    """A uniform draw from 0 to 1 is none of the first numbers of what the flight spawns from its seed."""
    one = {"key": "wind.head_mps", "distribution": "uniform", "low": 0.0, "high": 1.0}
    number = draws_of_seed(scenario_of(one), 3)["wind.head_mps"]
    for child in (SeedSequence(3), *SeedSequence(3).spawn(64)):
        assert number not in default_rng(child).random(64)


def test_a_scenario_without_dispersions_draws_nothing() -> None:
    landing = load_scenario("landing")
    assert keys_of(landing) == ()
    assert draws_of_seed(landing, 3) == Design(landing, 3, 2).draws(1) == {}
    assert dispersed(landing, {}) is landing
    assert described(landing) == []
    with pytest.raises(ValueError, match="at least one flight"):
        Design(landing, 0, 0)


# --- scenarios of drawn values ----------------------------------------------------------------------------------------


def numbers_in(table: dict[str, Any], prefix: str = "") -> dict[str, float]:
    """Dotted keys of the numbers in nested tables."""
    found: dict[str, float] = {}
    for name, value in table.items():
        if isinstance(value, dict):
            found |= numbers_in(value, f"{prefix}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[f"{prefix}{name}"] = value
    return found


def test_every_number_of_the_landing_but_the_box_can_be_drawn() -> None:
    with shipped_scenarios()["landing"].open("rb") as file:
        numbers = {key: value for key, value in numbers_in(tomllib.load(file)).items() if not key.startswith("box.")}
    assert set(numbers) | {"start.speed_mps"} == set(drawable(ScenarioFile))
    draws = {
        key: {"key": key, "distribution": "discrete", "values": [value]} for key, value in (numbers | NO_SPREAD).items()
    }
    for group in (set(draws) - set(NO_SPREAD), NO_SPREAD):  # what a seed spreads, and by how much: one of both
        scenario = scenario_of(*(draws[key] for key in group))
        assert len(keys_of(scenario)) == len(group) > 3
        drawn_again = dispersed(scenario, draws_of_seed(scenario, 0))
        assert resolved_toml(drawn_again) == resolved_toml(load_scenario("landing", NO_SPREAD))


def test_drawn_values_are_the_scenario_s() -> None:
    scenario = scenario_of(CROSS, {"key": "camera.width_px", "distribution": "discrete", "values": [640.0, 800.0]})
    values = draws_of_seed(scenario, 1)
    result = dispersed(scenario, values)
    assert result.start.cross_m == values["start.cross_m"]
    assert (result.camera.width_px, type(result.camera.width_px)) == (values["camera.width_px"], int)
    assert result.dispersions is None
    assert (result.name, result.path, result.aircraft_config) == (
        scenario.name,
        scenario.path,
        scenario.aircraft_config,
    )
    assert dispersed(result, values) == result
    for strange in ({}, {**values, "start.height_m": 60.0}):
        with pytest.raises(ValueError, match="dispersed keys"):
            dispersed(scenario, strange)


def test_a_value_that_is_not_allowed_is_told_with_its_flight_and_its_draw() -> None:
    """A number from so far out that a scenario is not refused for it."""
    noise = {"key": "camera.noise_px", "distribution": "normal", "mean": 1.0, "sigma": 0.15}
    scenario = scenario_of(CROSS, noise)
    bad = 3
    draws = [Design(scenario, 0, 5).draws(index) for index in range(5)]
    draws[bad]["camera.noise_px"] = -0.0625
    what = "dispersions.draw[1] gives camera.noise_px = -0.0625, which must be at least 0"
    advice = '; use "truncated-normal", with low and high, or "uniform"'
    with pytest.raises(ScenarioError) as caught:
        check_draws(scenario, draws)
    assert str(caught.value) == f"{scenario.path}: flight {bad} of the batch: {what}{advice}"
    with pytest.raises(ScenarioError) as caught:
        fly(scenario, bad, draws[bad])
    assert str(caught.value) == f"{scenario.path}: {what}{advice}"
    check_draws(scenario, draws[:bad])


def test_values_that_do_not_agree_with_each_other_are_told() -> None:
    """Each rate is allowed beside the other's own, 60 Hz and 120 Hz, but not both together."""
    camera = {"key": "camera.rate_hz", "distribution": "discrete", "values": [30.0, 120.0]}
    imu = {"key": "imu.rate_hz", "distribution": "discrete", "values": [120.0, 60.0]}
    scenario = scenario_of(camera, imu)
    with pytest.raises(
        ScenarioError, match=r"camera\.rate_hz = 120, which must divide imu\.rate_hz = 60; 120 does not$"
    ):
        check_draws(scenario, [Design(scenario, 0, 20).draws(index) for index in range(20)])


def test_check_tells_of_each_draw() -> None:
    group = {"keys": ["start.cross_m", "camera.noise_factor"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}
    lines = described(scenario_of(CROSS, WIDTH, RATE, NOISE, correlation=[group], sampling="sobol"))
    low, middle, high = (f"{value:.4g}" for value in LAW["runway.width_m"].ppf((0.05, 0.5, 0.95)))
    assert lines[0].split() == ["start.cross_m", "normal;", "5,", "50,", "95", "%:", "-12.16,", "1,", "14.16"]
    assert lines[1].endswith(f"truncated-normal added to 30; 5, 50, 95 %: {low}, {middle}, {high}")
    assert lines[2].endswith("discrete; one of 30 (50%), 15 (25%), 10 (25%)")
    assert lines[4:] == ["correlated: start.cross_m, camera.noise_factor", "sampling: sobol"]


# --- flights ----------------------------------------------------------------------------------------------------------


def test_a_flight_is_that_of_the_drawn_scenario() -> None:
    scenario = scenario_of(CROSS, NOISE, HEAD, others=SHORT)
    values = draws_of_seed(scenario, 3)
    flight, same = fly(scenario, 3), fly(dispersed(scenario, values), 3)
    assert flight.metrics["draws"] == values
    assert same.metrics["draws"] == {}
    assert flight.metrics["start"]["cross_m"] == values["start.cross_m"]
    for column in COLUMNS:
        np.testing.assert_array_equal(flight.log[column.name], same.log[column.name], err_msg=column.name)
    given = {**values, "start.cross_m": -4.0}
    assert fly(scenario, 3, given).metrics["start"]["cross_m"] == -4.0


def test_rows_have_the_draws_as_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = scenario_of(CROSS, RATE, others=SHORT)
    columns = ["draw.start.cross_m", "draw.camera.rate_hz"]
    assert list(scalars_of(scenario).items()) == [*SCALARS.items(), *((name, float) for name in columns)]
    values = {"start.cross_m": 1.5, "camera.rate_hz": 15.0}
    row = flight_row(scenario, 3, draws=values)
    assert {name: row[name] for name in columns} == {"draw.start.cross_m": 1.5, "draw.camera.rate_hz": 15.0}
    assert row["start_cross_m"] == 1.5
    seen = row["time_s"][np.isfinite(row["time_s"])]
    np.testing.assert_allclose(
        seen * 15.0, np.round(seen * 15.0), atol=1e-9
    )  # at frames, of which there are 15 a second
    assert len(seen) > 5

    def broken(*_: object) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(batch, "fly", broken)
    lost = flight_row(scenario, 3)
    assert lost["outcome"] == "error"
    assert {f"draw.{key}": value for key, value in draws_of_seed(scenario, 3).items()} == {n: lost[n] for n in columns}


def test_an_override_of_a_drawn_key_wins_and_the_others_are_drawn_as_without_it() -> None:
    plain = load_scenario("weather")
    foggy = load_scenario("weather", {"camera.visibility_m": 150.0, "wind.head_mps": 0})
    for seed in range(3):
        before, after = draws_of_seed(plain, seed), draws_of_seed(foggy, seed)
        assert after == before | {"camera.visibility_m": 150.0, "wind.head_mps": 0.0}
    again = tomllib.loads(resolved_toml(foggy))
    assert [draw["key"] for draw in again["dispersions"]["draw"]] == list(keys_of(plain))


def test_what_multiplies_a_key_multiplies_the_override() -> None:
    noisy = load_scenario("weather", {"pitot.noise_mps": 2.0 * load_scenario("weather").pitot.noise_mps})
    plain = draws_of_seed(load_scenario("weather"), 5)["pitot.noise_mps"]
    assert draws_of_seed(noisy, 5)["pitot.noise_mps"] == pytest.approx(2.0 * plain)


def test_the_shipped_dispersions_teach_each_distribution() -> None:
    scenario = load_scenario("dispersed")
    assert scenario.dispersions is not None
    assert {draw.distribution for draw in scenario.dispersions.draw} == set(
        DrawConfig.model_fields["distribution"].annotation.__args__  # type: ignore[union-attr]
    )
    assert {draw.apply for draw in scenario.dispersions.draw} == {"replace", "add", "multiply"}
    check_draws(scenario, [draws_of_seed(scenario, seed) for seed in range(300)])


# --- keys that are there to be drawn ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def nominal() -> Flight:
    return fly(load_scenario("landing", SHORT), 3)


def begun(flight: Flight) -> dict[str, np.ndarray]:
    """The log until the filter starts and guidance with it; until then the aircraft flies alone."""
    return {
        name: values[: int(np.argmax(np.isfinite(flight.log["fused_along_m"])))] for name, values in flight.log.items()
    }


def test_a_width_error_scales_what_the_camera_sees(nominal: Flight) -> None:
    """The same lines of a runway that is taken to be 1.02 times as wide are those of a scene 1.02 times as large."""
    wrong = begun(fly(load_scenario("landing", {**SHORT, "runway.width_error_m": 0.6}), 3))
    right = begun(nominal)
    frames = np.isfinite(right["vision_along_m"])
    assert frames.sum() > 10
    for name in ("along_m", "cross_m", "height_m"):
        np.testing.assert_allclose(wrong[f"vision_{name}"][frames], 1.02 * right[f"vision_{name}"][frames], rtol=1e-9)
        np.testing.assert_array_equal(wrong[f"true_{name}"], right[f"true_{name}"])
    np.testing.assert_allclose(wrong["vision_yaw_deg"][frames], right["vision_yaw_deg"][frames], atol=1e-9)


def test_the_log_s_truth_has_the_camera_s_own_tilt(nominal: Flight) -> None:
    wrong = fly(load_scenario("landing", {**SHORT, "camera.tilt_error_deg": 0.3}), 3).log
    np.testing.assert_allclose(wrong["tilt_deg"][:10], nominal.log["tilt_deg"][:10] + 0.3, rtol=1e-12)
    np.testing.assert_array_equal(wrong["tilt_reading_deg"][:10], nominal.log["tilt_reading_deg"][:10])
    lower = wrong["true_pitch_deg"][:10] - nominal.log["true_pitch_deg"][:10]
    np.testing.assert_allclose(lower, -0.3, atol=1e-4)  # the wings are as good as level


def test_a_longer_lens_is_a_nearer_runway(nominal: Flight) -> None:
    """Seen through a lens 1 % longer than believed, small things on the optical axis seem 1 % nearer."""
    wrong = begun(fly(load_scenario("landing", {**SHORT, "camera.focal_length_error": 0.01}), 3))
    right = begun(nominal)
    nearer = np.nanmean(wrong["vision_along_m"]) / np.nanmean(right["vision_along_m"])
    assert nearer == pytest.approx(1.0 / 1.01, abs=2e-3)


def test_the_wind_is_that_of_the_scenario() -> None:
    """A head wind slows the flight over the ground; one across, from the left, turns the nose left."""
    log = fly(load_scenario("landing", {**SHORT, **NO_SPREAD, "wind.head_mps": 4.0, "wind.cross_mps": 2.0}), 0).log
    assert log["true_airspeed_mps"][0] == pytest.approx(40.0, abs=1e-3)
    descent = math.radians(3.0)
    along, across = log["true_velocity_x_mps"][0], log["true_velocity_y_mps"][0]
    through_air = (along + 4.0, across - 2.0, along * math.tan(descent))
    assert math.hypot(*through_air) == pytest.approx(40.0, abs=2e-3)
    assert across == pytest.approx(0.0, abs=2e-3)
    assert log["body_yaw_deg"][0] == pytest.approx(-math.degrees(math.atan2(2.0, along + 4.0)), abs=0.01)


def test_the_loading_is_that_of_the_scenario(nominal: Flight) -> None:
    """More mass is carried by more incidence; a centre of gravity further ahead by an elevator further up."""
    heavy = fly(load_scenario("landing", {**SHORT, "loading.extra_mass_kg": 20.0}), 3).log
    assert heavy["body_pitch_deg"][0] > nominal.log["body_pitch_deg"][0] + 0.5
    ahead = fly(load_scenario("landing", {**SHORT, "loading.cg_forward_m": 0.03}), 3).log
    assert ahead["elevator_deg"][0] < nominal.log["elevator_deg"][0] - 0.5
