"""Scenario and aircraft files: what is taken, what is refused and in which words."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from landsim.config import (
    AircraftFile,
    BoundsConfig,
    Scenario,
    ScenarioError,
    ScenarioFile,
    StudyConfig,
    load_aircraft,
    load_scenario,
    parse_setting,
    resolved_toml,
)
from landsim.resources import find_scenario, shipped_aircraft, shipped_scenarios
from landsim.schema import Section, fields_by_key, rows

PLUG_IN_SETTINGS = {"plug-ins.estimator_settings", "plug-ins.controller_settings"}
MINIMAL = 'kind = "flight"\naircraft.name = "pioneer"\n'


def settings_of(scenario: ScenarioFile) -> dict[str, object]:
    """Everything that a file says: dotted key to value."""
    fields = fields_by_key(ScenarioFile).items()
    return {key: value for name, field in fields for key, value in _rows(name, getattr(scenario, field))}


def _rows(key: str, value: object) -> list[tuple[str, object]]:
    return list(rows(value, f"{key}.")) if isinstance(value, Section) else [(key, value)]


def refusal(tmp_path: Path, text: str, overrides: dict[str, object] | None = None) -> str:
    """The one line with which a scenario file is refused, less its path."""
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path, overrides)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def keys_of(table: dict[str, Any], prefix: str = "") -> set[str]:
    """Dotted keys of nested tables."""
    return {
        key
        for name, value in table.items()
        for key in (keys_of(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}"})
    }


class TestShipped:
    def test_landing_explains_every_key_and_has_its_default(self) -> None:
        with shipped_scenarios()["landing"].open("rb") as file:
            written = keys_of(tomllib.load(file))
        loaded = load_scenario("landing")
        # TOML cannot say "none"
        assert set(settings_of(loaded)) - written == {"start.speed_mps", "study", "dispersions", *PLUG_IN_SETTINGS}
        for key in ScenarioFile.model_fields:
            if key not in {"kind", "aircraft", "study", "dispersions"}:
                section = getattr(loaded, key)
                assert section == type(section)()

    def test_the_paper_s_studies_explain_every_key_of_a_study(self) -> None:
        written: set[str] = set()
        for name in ("paper-fig3", "paper-fig4", "paper-flight"):
            with shipped_scenarios()[name].open("rb") as file:
                written |= keys_of(tomllib.load(file)["study"])
        bounds = {f"bounds.{key}" for key in BoundsConfig.model_fields}
        assert {key for key in StudyConfig.model_fields if not key.startswith("bounds")} | bounds <= written

    @pytest.mark.parametrize("name", ["paper-fig3", "paper-fig4", "paper-flight"])
    def test_the_studies_are_the_paper_s(self, name: str) -> None:
        s = load_scenario(name)
        assert s.kind == "study"
        assert (s.start.along_m, s.start.cross_m, s.start.height_m, s.start.speed_mps) == (-1000.0, 0.0, 60.0, 40.0)
        assert (s.start.flight_path_deg, s.runway.width_m) == (-3.0, 30.0)
        assert (s.camera.focal_length_mm, s.camera.pixel_um) == (12.5, 9.9)
        assert (s.camera.width_px, s.camera.height_px, s.camera.rate_hz) == (658, 494, 30.0)
        assert s.camera.noise_px**2 == pytest.approx(2.0)
        assert (s.navigation.handover, s.simulation.end) == ("latched", "touchdown")
        study = s.study
        assert study is not None
        assert (study.pitch_early_deg, study.pitch_late_deg, study.end_height_m) == (-3.0, -10.0, 2.0)
        assert (study.flights, set(study.readings)) == (100, {"endpoints", "edge-points"})

    def test_landing_is_the_flight_of_the_paper(self) -> None:
        s = load_scenario("landing")
        assert (s.kind, s.name, s.aircraft.name, s.aircraft_config.name) == ("flight", "landing", "pioneer", "pioneer")
        assert (s.start.along_m, s.start.height_m, s.runway.width_m) == (-1000.0, 60.0, 30.0)
        assert (s.camera.width_px, s.camera.height_px, s.camera.focal_length_mm) == (658, 494, 12.5)

    @pytest.mark.parametrize("name", list(shipped_scenarios()))
    def test_every_scenario_loads(self, name: str) -> None:
        assert load_scenario(name).path == shipped_scenarios()[name]

    @pytest.mark.parametrize("name", list(shipped_aircraft()))
    def test_every_aircraft_loads(self, name: str) -> None:
        aircraft = load_aircraft(name)
        assert aircraft.name == name
        assert (aircraft.folder / f"{aircraft.model}.xml").is_file()
        # The nose wheel is ahead of the mains, which stand either side, all of them below the centre of gravity.
        left, right, nose = (getattr(aircraft.gear, f"{w}_wheel_body_m") for w in ("left", "right", "nose"))
        assert nose[0] > 0.0 > left[0] == right[0]
        assert left[1] < 0.0 < right[1]
        assert min(left[2], right[2], nose[2]) > 0.0


class TestOverrides:
    def test_replaces_the_files_value(self) -> None:
        assert load_scenario("landing", {"runway.width_m": 45.0}).runway.width_m == 45.0

    def test_whole_numbers_stand_for_floats(self) -> None:
        width = load_scenario("landing", {"runway.width_m": 45}).runway.width_m
        assert (width, type(width)) == (45.0, float)

    def test_lists_become_tuples(self) -> None:
        s = load_scenario("landing", {"camera.outages_s": [[1, 2.5], [3.0, 4.0]]})
        assert s.camera.outages_s == ((1.0, 2.5), (3.0, 4.0))
        assert hash(s.camera) == hash(s.camera.model_copy())

    def test_makes_the_table_it_needs(self, tmp_path: Path) -> None:
        path = tmp_path / "mine.toml"
        path.write_text(MINIMAL)
        assert load_scenario(path, {"pitot.lag_s": 0.25}).pitot.lag_s == 0.25

    def test_the_mapping_given_is_left_alone(self) -> None:
        overrides: dict[str, object] = {"camera": {"rate_hz": 15.0}, "camera.noise_px": 1.0}
        loaded = load_scenario("landing", overrides)
        assert (loaded.camera.rate_hz, loaded.camera.noise_px) == (15.0, 1.0)
        assert overrides == {"camera": {"rate_hz": 15.0}, "camera.noise_px": 1.0}

    def test_models_are_frozen(self) -> None:
        scenario = load_scenario("landing")
        with pytest.raises(ValidationError, match="frozen"):
            scenario.runway.width_m = 45.0  # type: ignore[misc]


REFUSED: list[tuple[str, object, str]] = [
    ("runway.widht_m", 30.0, "override runway.widht_m: unknown key; did you mean runway.width_m?"),
    ("camra.rate_hz", 30.0, "override camra: unknown key; did you mean camera?"),
    ("camera.zzz", 1, "override camera.zzz: unknown key; known: focal_length_mm, focal_length_error, "),
    ("runway.width_m", -30.0, "override runway.width_m: must be above 0, not -30.0"),
    ("runway.width_m", 0, "override runway.width_m: must be above 0, not 0"),
    ("runway.width_m", float("nan"), "override runway.width_m: must be a finite number, not nan"),
    ("start.speed_mps", float("inf"), "override start.speed_mps: must be a finite number, not inf"),
    ("start.speed_mps", -1.0, "override start.speed_mps: must be above 0, not -1.0"),
    ("runway.width_m", "30", 'override runway.width_m: must be a number, not "30"'),
    ("runway.width_m", True, "override runway.width_m: must be a number, not true"),
    ("runway.width_m", None, "override runway.width_m: must be a number, not None"),
    ("runway.width_m", [30.0], "override runway.width_m: must be a number, not [30.0]"),
    ("runway.width_m", 10**400, "override runway.width_m: must be a number, not 1000"),
    ("runway.width_m.deep", 1.0, "override runway.width_m: must be a number, not a table"),
    ("kind.deep", 1.0, "override kind.deep: kind is not a table"),
    ("runway", 30.0, "override runway: must be a table, not 30.0"),
    ("camera.focal_length_mm", 0.0, "override camera.focal_length_mm: must be above 0, not 0.0"),
    ("camera.width_px", 658.0, "override camera.width_px: must be a whole number, not 658.0"),
    ("camera.noise_px", -0.1, "override camera.noise_px: must be at least 0, not -0.1"),
    ("camera.min_line_px", 1.5, "override camera.min_line_px: must be at least 2, not 1.5"),
    (
        "camera.line_noise",
        "endpoint",
        'must be "edge-points" or "endpoints", not "endpoint"; did you mean "endpoints"?',
    ),
    ("camera.outages_s", [[2.0, 1.0]], "override camera.outages_s: each window must be [from, to]"),
    ("camera.outages_s", [[1.0, 3.0], [2.0, 4.0]], "override camera.outages_s: windows must follow each other"),
    ("camera.outages_s", [[1.0]], "override camera.outages_s[0]: element 2 is missing"),
    ("camera.outages_s", [[1.0, 2.0, 3.0]], "override camera.outages_s[0]: must have 2 elements, not 3"),
    ("camera.rate_hz", 50.0, "override camera.rate_hz: must divide simulation.rate_hz = 120; 50 does not"),
    ("imu.rate_hz", 240.0, "override imu.rate_hz: must divide simulation.rate_hz = 120; 240 does not"),
    ("approach.glide_slope_deg", 15.0, "override approach.glide_slope_deg: must be below 15, not 15.0"),
    ("approach.aim_point_m", 2000.0, "override approach.aim_point_m: must be below runway.length_m = 2000, not 2000"),
    ("start.along_m", 0.0, "override start.along_m: must be below 0, not 0.0"),
    ("start.height_m", 0.0, "override start.height_m: must be above 0, not 0.0"),
    ("box.along_max_m", 50.0, "override box.along_max_m: must be above along_min_m = 100, not 50"),
    ("kind", "study", 'study: is missing, which kind = "study" needs'),
    ("study.ranges_m", [1.0], 'study: belongs to kind = "study"'),
    ("kind", "flihgt", 'override kind: must be "flight" or "study", not "flihgt"; did you mean "flight"?'),
    ("aircraft.name", "pionere", 'no aircraft "pionere": neither a folder nor a shipped name; did you mean pioneer?'),
    ("aircraft.name", "", "override aircraft.name: "),
    ("aircraft.name", "./nowhere", 'override aircraft.name: no aircraft "./nowhere": nowhere/aircraft.toml does not'),
]


REFUSED_STUDY: list[tuple[str, object, str]] = [
    ("study.darws", 1000, "override study.darws: unknown key; did you mean study.draws?"),
    ("study.bounds.cros_m", 1.0, "override study.bounds.cros_m: unknown key; did you mean study.bounds.cross_m?"),
    ("study.ranges_m", [100.0, 100.0], "override study.ranges_m: must fall from each to the next, not [100.0, 100.0]"),
    ("study.ranges_m", [], "override study.ranges_m: must have at least 1 element, not 0"),
    ("study.readings", ["corner"], 'override study.readings[0]: must be "endpoints" or "edge-points", not "corner"'),
    ("study.draws", 99, "override study.draws: must be at least 100, not 99"),
    ("study.bounds.yaw_deg", 0.0, "override study.bounds.yaw_deg: must be above 0, not 0.0"),
    ("study.stage", "midle", 'override study.stage: must be "early", "late" or "both", not "midle"'),
    ("study", 3, "override study: must be a table, not 3"),
]


class TestRefused:
    @pytest.mark.parametrize(("key", "value", "told"), REFUSED_STUDY, ids=[k for k, _, _ in REFUSED_STUDY])
    def test_override_of_a_study(self, key: str, value: object, told: str) -> None:
        with pytest.raises(ScenarioError) as caught:
            load_scenario("paper-fig3", {key: value})
        assert told in str(caught.value)

    def test_flights_that_are_none(self) -> None:
        with pytest.raises(ScenarioError, match=r'study\.flights: must be at least 2 with method = "flights", not 1'):
            load_scenario("paper-flight", {"study.flights": 1})

    @pytest.mark.parametrize(("key", "value", "told"), REFUSED, ids=[f"{k}={str(v)[:9]}" for k, v, _ in REFUSED])
    def test_override(self, key: str, value: object, told: str, tmp_path: Path) -> None:
        assert told in refusal(tmp_path, MINIMAL, {key: value})

    @pytest.mark.parametrize(
        ("text", "told"),
        [
            ("", "kind: is missing"),
            ('kind = "flight"\n', "aircraft: is missing"),
            ('kind = "flight"\naircraft = {}\n', "aircraft.name: is missing"),
            ("kind =\n", "not valid TOML: Invalid value (at line 1"),
            (
                MINIMAL + "[runway]\nwidth_m = 30.0\nwidth_m = 31.0\n",
                "not valid TOML: Cannot overwrite a value (at line 5",
            ),
            (MINIMAL + "[runway]\nwidth_m = nan\n", "runway.width_m: must be a finite number, not nan"),
            (MINIMAL + "[runway]\nwidth_m = 2026-01-01\n", "runway.width_m: must be a number, not 2026-01-01"),
            (MINIMAL + '[runway]\n"width\\nm" = 1\n', "runway.width\\nm: unknown key; did you mean runway.width_m?"),
            (MINIMAL + "[runway]\nwidth_m = -1\nlenght_m = 1\n", "runway.lenght_m: unknown key; did you mean"),
            (MINIMAL + "aircraft.nmae = 1\n", "aircraft.nmae: unknown key; did you mean aircraft.name?"),
            (MINIMAL + "name = 1\n", "name: unknown key"),
            (MINIMAL + "aircraft_config = 1\n", "aircraft_config: unknown key; did you mean aircraft?"),
            ("a = " + "[" * 5000, "not valid TOML: "),
        ],
    )
    def test_file(self, text: str, told: str, tmp_path: Path) -> None:
        line = refusal(tmp_path, text)
        assert line.startswith(told)
        assert "override" not in line

    def test_not_text(self, tmp_path: Path) -> None:
        path = tmp_path / "mine.toml"
        path.write_bytes(b"kind = 'flight'\n# \xff\n")
        with pytest.raises(ScenarioError, match=r"mine\.toml: not valid TOML: line 2 is not UTF-8 text$"):
            load_scenario(path)

    @pytest.mark.parametrize(
        ("name", "told"),
        [
            ("landign", 'no scenario "landign": neither a file nor a shipped name; did you mean landing?'),
            ("nowhere.toml", "nowhere.toml: no such scenario file"),
            ("nowhere/landing", "nowhere/landing: no such scenario file"),
            (".", ".: is a folder; a scenario is a TOML file"),
        ],
    )
    def test_no_such_scenario(self, name: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(ScenarioError) as caught:
            load_scenario(name)
        assert str(caught.value) == told

    def test_every_key_is_recognised_with_a_letter_missing(self) -> None:
        for key in settings_of(load_scenario("paper-fig3")):
            *section, name = key.split(".")
            misspelt = ".".join([*section, name[:2] + name[3:]])
            with pytest.raises(ScenarioError) as caught:
                load_scenario("paper-fig3", {misspelt: 1})
            assert f"{misspelt}: unknown key; did you mean {key}?" in str(caught.value)

    @given(content=st.one_of(st.binary(max_size=60), st.text(max_size=60).map(str.encode)))
    def test_whatever_a_file_holds_the_error_is_one_line(self, content: bytes, tmp_path: Path) -> None:
        path = tmp_path / "mine.toml"
        path.write_bytes(content)
        with pytest.raises(ScenarioError) as caught:
            load_scenario(path)
        assert len(str(caught.value).splitlines()) == 1


def _finite(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


VALUES: dict[str, st.SearchStrategy[object]] = {
    "runway.width_m": _finite(2.0, 1000.0),
    "runway.heading_deg": st.integers(-360, 360),
    "approach.glide_slope_deg": _finite(0.001, 14.9),
    "start.along_m": _finite(-1e5, -1e-9),
    "start.speed_mps": st.none() | _finite(1.0, 100.0),
    "camera.width_px": st.integers(16, 20000),
    "camera.line_noise": st.sampled_from(["edge-points", "endpoints"]),
    "camera.outages_s": st.lists(_finite(0.0, 99.0), unique=True, max_size=6).map(
        lambda times: [list(pair) for pair in zip(sorted(times)[::2], sorted(times)[1::2], strict=False)]
    ),
    "camera.rate_hz": st.integers(1, 120).map(lambda n: 120.0 / n),
    "imu.scale_factor": _finite(0.0, 0.49),
    "navigation.start_frames": st.integers(2, 1000),
}


class TestRoundTrip:
    @given(overrides=st.fixed_dictionaries({}, optional=VALUES))
    def test_resolved_loads_to_the_same(self, overrides: dict[str, object], tmp_path: Path) -> None:
        scenario = load_scenario("landing", overrides)
        path = tmp_path / "resolved.toml"
        path.write_text(resolved_toml(scenario), encoding="utf-8")
        again = load_scenario(path)
        assert settings_of(again) == settings_of(scenario)
        assert again.aircraft_config == scenario.aircraft_config
        assert settings_of(scenario).keys() >= overrides.keys()

    @pytest.mark.parametrize(
        ("name", "overrides", "none"),
        [
            ("landing", {"start.speed_mps": 39.0}, {"study", "dispersions", *PLUG_IN_SETTINGS}),
            (
                "paper-fig3",
                {},
                {f"study.bounds_late.{key}" for key in BoundsConfig.model_fields} | {"dispersions", *PLUG_IN_SETTINGS},
            ),
        ],
    )
    def test_resolved_says_every_key(self, name: str, overrides: dict[str, object], none: set[str]) -> None:
        scenario = load_scenario(name, overrides)
        assert keys_of(tomllib.loads(resolved_toml(scenario))) == set(settings_of(scenario)) - none

    @given(
        overrides=st.fixed_dictionaries(
            {},
            optional={
                "study.stage": st.sampled_from(["early", "late", "both"]),
                "study.readings": st.sampled_from([["endpoints"], ["edge-points", "endpoints"]]),
                "study.ranges_m": st.lists(_finite(-1e5, 1e5), unique=True, min_size=1, max_size=5).map(
                    lambda ranges: sorted(ranges, reverse=True)
                ),
                "study.roll_errors_deg": st.lists(_finite(-20.0, 20.0), unique=True, min_size=1, max_size=3),
                "study.flights": st.integers(0, 100_000),
                "study.bounds.cross_m": _finite(1e-6, 1e6),
                "study.bounds_late.yaw_deg": _finite(1e-6, 90.0),
            },
        )
    )
    def test_a_resolved_study_loads_to_the_same(self, overrides: dict[str, object], tmp_path: Path) -> None:
        scenario = load_scenario("paper-fig4", overrides)
        path = tmp_path / "resolved.toml"
        path.write_text(resolved_toml(scenario), encoding="utf-8")
        assert settings_of(load_scenario(path)) == settings_of(scenario)


class TestAircraft:
    def test_a_path_in_a_file_is_relative_to_the_file(
        self, tmp_path: Path, aircraft_copy: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = aircraft_copy("hangar/mine")
        path = tmp_path / "mine.toml"
        path.write_text('kind = "flight"\naircraft.name = "hangar/mine"\n')
        monkeypatch.chdir("/")
        loaded = load_scenario(path)
        assert loaded.aircraft_config.folder == folder.resolve()
        # The resolved file is found from anywhere: it names the folder in full.
        assert loaded.aircraft.name == str(folder.resolve())

    def test_a_path_in_an_override_is_relative_to_the_working_directory(
        self, tmp_path: Path, aircraft_copy: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = aircraft_copy("mine")
        monkeypatch.chdir(tmp_path)
        assert load_scenario("landing", {"aircraft.name": "mine"}).aircraft_config.folder == folder.resolve()

    def test_a_users_folder_wins_over_a_shipped_name(
        self, tmp_path: Path, aircraft_copy: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = aircraft_copy("pioneer")
        monkeypatch.chdir(tmp_path)
        assert load_aircraft("pioneer").folder == folder.resolve()
        assert load_scenario("landing").aircraft_config.folder == shipped_aircraft()["pioneer"]

    @pytest.mark.parametrize(
        ("old", "new", "told"),
        [
            ("[speeds]", "[speed]", "speed: unknown key; did you mean speeds?"),
            ("approach_mps", "aproach_mps", "speeds.aproach_mps: unknown key; did you mean speeds.approach_mps?"),
            ("nose_wheel_body_m = [", "nose_wheel_body_m = [1.0, ", "gear.nose_wheel_body_m: must have 3 elements"),
            ('model = "pioneer"', 'model = "other"', "model: "),
        ],
    )
    def test_errors_name_file_and_key(
        self, old: str, new: str, told: str, aircraft_copy: Callable[[str], Path]
    ) -> None:
        path = aircraft_copy("mine") / "aircraft.toml"
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(ScenarioError) as caught:
            load_aircraft(path.parent)
        assert str(caught.value).startswith(f"{path}: {told}")

    def test_bookkeeping_is_not_part_of_the_file(self) -> None:
        assert set(Scenario.model_fields) - set(ScenarioFile.model_fields) == {"name", "path", "aircraft_config"}
        assert "folder" not in AircraftFile.model_fields


class TestSettings:
    @pytest.mark.parametrize(
        ("text", "key", "value"),
        [
            ("runway.width_m=45.0", "runway.width_m", 45.0),
            ("runway.width_m = 45", "runway.width_m", 45),
            ("camera.line_noise=endpoints", "camera.line_noise", "endpoints"),
            ('camera.line_noise="endpoints"', "camera.line_noise", "endpoints"),
            ("camera.outages_s=[[1, 2]]", "camera.outages_s", [[1, 2]]),
            ("a=true", "a", True),
            ("aircraft.name=./my=plane", "aircraft.name", "./my=plane"),
            ("runway.width_m=30x", "runway.width_m", "30x"),
        ],
    )
    def test_value_is_toml_or_a_word(self, text: str, key: str, value: object) -> None:
        parsed = parse_setting(text)
        assert parsed == (key, value)
        assert type(parsed[1]) is type(value)

    @pytest.mark.parametrize(
        "text", ["", "a", "a=", "=1", "a=[1", 'a="b', "a={b", "..=3", "a..b=3", ".a=3", "a.=3", "\udcff=3", "a=\udcff"]
    )
    def test_anything_else_is_refused(self, text: str) -> None:
        with pytest.raises(ScenarioError, match=r"^setting "):
            parse_setting(text)


@pytest.mark.parametrize("key", [1, None, "", ".", "runway..width_m", "runway.", "\udcff"])
def test_an_override_that_is_no_dotted_key_is_refused(key: Any) -> None:
    with pytest.raises(ScenarioError, match=r"landing\.toml: override .*: must be a dotted key") as caught:
        load_scenario("landing", {key: 2})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("name", "unknown key; did you mean aircraft.name?"),
        ("rate_hz", "unknown key; did you mean camera.rate_hz, imu.rate_hz or simulation.rate_hz?"),
        ("camera.heading_deg", "unknown key; did you mean runway.heading_deg or start.heading_deg?"),
    ],
)
def test_a_key_in_the_wrong_table_is_told_where_it_is(key: str, told: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("landing", {key: 1})
    assert str(caught.value).endswith(f"override {key}: {told}")


@pytest.mark.parametrize("name", ["", " ", "x" * 300, "~nobody-of-that-name/x"])
def test_what_names_no_file_is_refused(name: str) -> None:
    with pytest.raises(ScenarioError, match=r"no scenario named|cannot be read"):
        load_scenario(name)


def test_a_users_file_wins_over_a_shipped_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "landing").write_text(MINIMAL)
    assert find_scenario("landing") == shipped_scenarios()["landing"]
    monkeypatch.chdir(tmp_path)
    assert find_scenario("landing") == (tmp_path / "landing").resolve()


def test_an_image_that_is_always_too_late_is_refused(tmp_path: Path) -> None:
    text = MINIMAL + 'navigation.aiding = "lines"\ncamera.latency_s = 2.0\n'
    told = refusal(tmp_path, text)
    assert told == "camera.latency_s: must be below navigation.unaided_s = 2, or every frame comes too late; not 2"
    assert refusal(tmp_path, text.replace("2.0", "1.5"), {"navigation.unaided_s": 1.0}).startswith("camera.latency_s: ")
