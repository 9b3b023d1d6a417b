"""The page on sensors: its keys are those of the schema, its grades those that fly, its commands run.

Its Allan deviations are held against the measured ones by tests/test_imu_errors.py.
"""

import re
import shlex
from pathlib import Path

import pytest

import landsim
from landsim.cli import landsim as program
from landsim.config import CameraConfig, FaultConfig, ImuConfig, NavigationConfig, load_scenario
from landsim.schema.grades import FLOOR, GRADES

ROOT = Path(landsim.__file__).parents[1]
PAGE = (ROOT / "docs/sensors.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line.startswith("|")]


def row(*begin: str) -> list[str]:
    (found,) = (cells for cells in ROWS if cells[: len(begin)] == list(begin))
    return found[len(begin) :]


def test_commands_are_known() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("landsim ")]
    assert len(lines) == 4
    for line in lines:
        command, *arguments = shlex.split(line)[1:]
        program.commands[command].make_context(command, list(arguments))
        changes = dict(text.split("=") for text in arguments if "=" in text)
        load_scenario(arguments[0], overrides={key: _value(text) for key, text in changes.items()})


def _value(text: str) -> str | float:
    return text if text.isalpha() else float(text)


def test_every_key_of_an_error_is_on_the_page_and_exists() -> None:
    named = set(re.findall(r"`([a-z_0-9]+)`", PAGE))
    errors = {name for name in CameraConfig.model_fields if name.endswith(("_error", "_error_deg", "_error_px"))}
    errors |= {"radial_distortion", "latency_s", "dropped_share", "exposure_s", "visibility_m", "outages_s"}
    errors |= set(FaultConfig.model_fields) | (set(ImuConfig.model_fields) - {"rate_hz", "grade"})
    errors |= {
        name
        for name in NavigationConfig.model_fields
        if "_sigma" in name and not name.startswith(("start_", "handover_", "max_"))
    }
    assert errors <= named
    keys = {name for config in (CameraConfig, FaultConfig, ImuConfig, NavigationConfig) for name in config.model_fields}
    endings = ("_deg", "_px", "_share", "_error", "_s", "_m", "_factor", "_sqrt_h", "_mg", "_deg_h")
    assert {name for name in named if name.endswith(endings)} <= keys


def test_grades_on_the_page_are_those_that_fly() -> None:
    floor = {"gyro_bias_instability_deg_h", "accel_bias_instability_mg"}
    rows = {
        "gyro noise, °/√h": "gyro_noise_deg_sqrt_h",
        "gyro instability as on the sheet, °/h": "gyro_bias_instability_deg_h",
        "gyro walk, °/h/√h": "gyro_bias_drift_deg_h_sqrt_h",
        "gyro bias, °/h": "gyro_bias_deg_h",
        "accelerometer noise, m/s/√h": "accel_noise_mps_sqrt_h",
        "accelerometer instability as on the sheet, mg": "accel_bias_instability_mg",
        "accelerometer walk, mg/√h": "accel_bias_drift_mg_sqrt_h",
        "accelerometer bias, mg": "accel_bias_mg",
        "scale factor, gyro and accelerometer": "scale_factor",
    }
    for name, key in rows.items():
        for text, numbers in zip(row(name)[:3], GRADES.values(), strict=True):
            assert float(text) == pytest.approx(numbers[key] * (FLOOR if key in floor else 1.0)), (name, text)
    assert all(set(numbers) == set(rows.values()) for numbers in GRADES.values())


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#:]+)\)", PAGE))
def test_links_lead_somewhere(target: str) -> None:
    assert (ROOT / "docs" / target).exists()
