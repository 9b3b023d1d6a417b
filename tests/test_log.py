"""The log's table of columns, and its file."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import fake_flight

from landsim.errors import RunFolderError
from landsim.log import COLUMNS, Log, load_log, save_log

CONTRACT = [
    f"{source}_{quantity}"
    for source in ("true", "vision", "fused", "sigma")
    for quantity in ("along_m", "cross_m", "height_m", "roll_deg", "pitch_deg", "yaw_deg")
]
UNIT_ENDINGS = {"m": "_m", "deg": "_deg", "s": "_s", "m/s": "_mps", "m/s²": "_mps2", "deg/h": "_deg_h"}


def test_columns_of_the_contract_are_there_once() -> None:
    names = [column.name for column in COLUMNS]
    assert len(set(names)) == len(names)
    assert {"time_s", *CONTRACT} <= set(names)


def test_a_name_ends_in_its_unit() -> None:
    for column in COLUMNS:
        assert column.name.endswith(UNIT_ENDINGS.get(column.unit, "")), column


def test_values_come_back_bit_for_bit(tmp_path: Path) -> None:
    # Not a number with a payload, both zeros, the smallest and the largest float, infinity.
    bits = [0x7FF8000000000001, 0x0, 0x8000000000000000, 0x1, 0x7FEFFFFFFFFFFFFF, 0xFFF0000000000000]
    values = np.array(bits, dtype=np.uint64).view(np.float64)
    log = {column.name: np.roll(values, i) for i, column in enumerate(COLUMNS)}
    save_log(tmp_path / "log.parquet", log)
    again = load_log(tmp_path / "log.parquet")
    assert list(again) == [column.name for column in COLUMNS]
    for name, column in again.items():
        assert column.dtype == np.float64
        np.testing.assert_array_equal(column.view(np.uint64), log[name].view(np.uint64))


def test_the_same_log_makes_the_same_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        save_log(tmp_path / name, fake_flight().log)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_log_without_rows(tmp_path: Path) -> None:
    save_log(tmp_path / "log.parquet", {column.name: np.empty(0) for column in COLUMNS})
    assert all(column.shape == (0,) for column in load_log(tmp_path / "log.parquet").values())


def test_another_reader_finds_unit_and_frame(tmp_path: Path) -> None:
    save_log(tmp_path / "log.parquet", fake_flight().log)
    schema = pq.read_schema(tmp_path / "log.parquet")
    metadata = schema.field("true_velocity_y_mps").metadata
    assert (metadata[b"unit"], metadata[b"frame"]) == (b"m/s", b"runway")
    assert schema.field("fused_roll_deg").metadata[b"unit"] == b"deg"
    assert pq.read_table(tmp_path / "log.parquet")["time_s"].null_count == 0


def test_nothing_is_left_beside(tmp_path: Path) -> None:
    save_log(tmp_path / "log.parquet", fake_flight().log)
    assert [path.name for path in tmp_path.iterdir()] == ["log.parquet"]


def _without(log: Log) -> Log:
    return {name: column for name, column in log.items() if name != "nis"}


@pytest.mark.parametrize(
    ("log", "told"),
    [
        (_without(fake_flight().log), "log: column nis is missing"),
        (fake_flight().log | {"nsi": np.zeros(3)}, "log: unknown column nsi; did you mean nis?"),
        (fake_flight().log | {"nis": np.zeros(2)}, r"log: column nis has shape \(2,\), time_s has \(3,\)"),
    ],
)
def test_another_table_is_refused(log: Log, told: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=told):
        save_log(tmp_path / "log.parquet", log)
    assert not list(tmp_path.iterdir())


def test_what_is_not_a_log_is_told_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("not a table")
    for name in ("text", "nothing", "."):
        with pytest.raises(RunFolderError, match="cannot be read") as caught:
            load_log(tmp_path / name)
        assert len(str(caught.value).splitlines()) == 1
