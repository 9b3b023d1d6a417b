"""A study's files that somebody has changed are told in one line, and so is a study of nothing."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from landsim.config import load_scenario, resolved_toml
from landsim.errors import RunFolderError, ScenarioError
from landsim.study.folder import ENVELOPES_FILE, SCENARIO_FILE, VERDICT_FILE, read_study, save_envelopes
from landsim.study.model import OF_STAGE, Envelope
from landsim.study.plan import plan_of

DISTANCE = np.array([400.0, 200.0, 100.0])


def hand_made() -> Envelope:
    names = OF_STAGE["early"]
    errors = np.full((3, len(names)), 0.1)
    return Envelope(
        stage="early",
        reading="endpoints",
        source="vision",
        roll_error=0.0,
        quantities=names,
        distance=DISTANCE,
        time=np.array([15.0, 20.0, 22.5]),
        height=np.array([28.5, 18.1, 12.8]),
        count=np.full(3, 1000),
        percentiles=np.repeat(errors[..., None], 3, axis=-1),
        sigma=errors,
        single=-errors,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    curves = {"range_m": [400.0], "height_m": [28.5], "endpoints": {}, "edge-points": {}}
    verdict = {
        "scenario": "mine",
        "seed": 3,
        "entries": [],
        "claims": {"tilt": {"pitch_down_deg": [0.0, 1.0], "early": curves, "late": curves}},
    }
    (tmp_path / VERDICT_FILE).write_text(json.dumps(verdict), encoding="utf-8")
    (tmp_path / SCENARIO_FILE).write_text(resolved_toml(load_scenario("paper-fig3")), encoding="utf-8")
    save_envelopes(tmp_path / ENVELOPES_FILE, [hand_made()], [])
    return tmp_path


def test_what_was_written_is_read(folder: Path) -> None:
    study = read_study(folder)
    assert (study.scenario.name, study.verdict["seed"]) == ("mine", 3)
    (found,) = study.envelopes
    np.testing.assert_array_equal(found.distance, DISTANCE)
    np.testing.assert_allclose(found.percentiles, hand_made().percentiles, rtol=1e-12)


@pytest.mark.parametrize(
    ("tilt", "told"),
    [
        ({}, "claims.tilt.pitch_down_deg is missing"),
        (3, "claims.tilt must be a table"),
        ({"pitch_down_deg": [0.0, 1.0], "early": {}, "late": {}}, "claims.tilt.early.range_m is missing"),
    ],
)
def test_changed_verdict(folder: Path, tilt: Any, told: str) -> None:
    verdict = json.loads((folder / VERDICT_FILE).read_text(encoding="utf-8"))
    verdict["claims"]["tilt"] = tilt
    (folder / VERDICT_FILE).write_text(json.dumps(verdict), encoding="utf-8")
    with pytest.raises(RunFolderError, match=told):
        read_study(folder)


@pytest.mark.parametrize(
    ("column", "value", "told"),
    [
        ("stage", "middle", "stage holds 'middle'; known: early, late"),
        ("reading", "foo", "reading holds 'foo'"),
        ("quantity", "spin", "quantity holds 'spin'"),
        ("distance_m", None, "distance_m has gaps"),
    ],
)
def test_changed_envelopes(folder: Path, column: str, value: Any, told: str) -> None:
    path = folder / ENVELOPES_FILE
    table = pq.read_table(path)
    index = table.column_names.index(column)
    values = pa.array([value] * table.num_rows, table.schema.field(column).type)
    pq.write_table(table.set_column(index, column, values), path)
    with pytest.raises(RunFolderError, match=told):
        read_study(folder)


def test_envelopes_without_rows(folder: Path) -> None:
    path = folder / ENVELOPES_FILE
    pq.write_table(pq.read_table(path).slice(0, 0), path)
    with pytest.raises(RunFolderError, match="it has no rows"):
        read_study(folder)


def test_lines_without_noise_are_not_studied() -> None:
    with pytest.raises(ScenarioError, match=r"camera\.noise_px: must be at least"):
        plan_of(load_scenario("paper-fig3", overrides={"camera.noise_px": 0.0}))
