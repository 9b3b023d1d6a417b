"""The log of a flight: one table of columns, each with a name, a unit and a frame; saved as Parquet.

A row is one step of the plant.  What a camera frame gives is NaN in the rows between frames.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from landsim.errors import did_you_mean
from landsim.parquet import read_table, write_table

Log: TypeAlias = dict[str, NDArray[np.float64]]
"""Columns by name, all of one length."""

QUANTITIES = ("along_m", "cross_m", "height_m", "roll_deg", "pitch_deg", "yaw_deg")
"""Of the camera triad in the runway frame; height is positive up."""
SOURCES = ("true", "vision", "fused", "sigma")
LINES = ("left", "threshold", "right")
ENDS = ("u0", "v0", "u1", "v1")
AXES = ("x", "y", "z")
CALIBRATION = (
    "camera_tilt_error_deg", "camera_pan_error_deg", "camera_roll_error_deg", "focal_length_error",
    "principal_u_error_px", "principal_v_error_px", "radial_distortion", "runway_width_error_m",
)  # fmt: skip
"""Of the camera and the runway, in the order of `estimator.single_lines.Calibration`; the width is the true one less
that believed."""


@dataclass(frozen=True)
class Column:
    """One column of the log."""

    name: str
    unit: str
    frame: str
    what: str


def _pose() -> list[Column]:
    kinds = {
        "true": "true pose of the camera",
        "vision": "pose from this frame's lines alone; NaN between frames and where the lines do not give it",
        "fused": "pose from the filter",
        "sigma": "the filter's own standard deviation of the fused pose",
    }
    return [
        Column(f"{source}_{q}", q.rsplit("_", 1)[1], "camera triad in runway", kinds[source])
        for source in SOURCES
        for q in QUANTITIES
    ]


def _vector(prefix: str, unit: str, frame: str, what: str, suffix: str) -> list[Column]:
    return [Column(f"{prefix}_{axis}_{suffix}", unit, frame, f"{what}, {axis}") for axis in AXES]


def _calibration() -> list[Column]:
    columns = []
    for name in CALIBRATION:
        unit = next((unit for unit in ("deg", "px", "m") if name.endswith(f"_{unit}")), "1")
        what = name.rsplit("_", 1)[0].replace("_", " ") if unit != "1" else name.replace("_", " ")
        columns.append(Column(f"fused_{name}", unit, "", f"{what} by the filter; NaN where it is not estimated"))
        columns.append(Column(f"sigma_{name}", unit, "", f"{what}: the filter's standard deviation"))
    return columns


def _ends(kind: str, what: str) -> list[Column]:
    return [Column(f"{line}_{kind}_{end}", "px", "image", f"{line} line {what}") for line in LINES for end in ENDS]


COLUMNS: tuple[Column, ...] = (
    Column("time_s", "s", "", "time since the start"),
    Column("phase", "", "", "landsim.state.Phase: 0 acquire, 1 approach, 2 flare, 3 rollout, 4 stopped, 5 go-around"),
    Column("stage", "", "", "landsim.state.Stage of the last frame: 0 none, 1 early, 2 late"),
    *_pose(),
    # the body
    Column("body_x_m", "m", "runway", "true nominal centre of gravity, along"),
    Column("body_y_m", "m", "runway", "true nominal centre of gravity, right of the centreline"),
    Column("body_height_m", "m", "runway", "true nominal centre of gravity, up"),
    Column("wheel_height_m", "m", "runway", "true height of the midpoint of the main wheels, unloaded"),
    Column("body_roll_deg", "deg", "body in runway", "true bank angle"),
    Column("body_pitch_deg", "deg", "body in runway", "true pitch angle"),
    Column("body_yaw_deg", "deg", "body in runway", "true heading relative to the runway's"),
    *_vector("true_velocity", "m/s", "runway", "true velocity", "mps"),
    *_vector("fused_velocity", "m/s", "runway", "velocity from the filter", "mps"),
    *_vector("sigma_velocity", "m/s", "runway", "the filter's standard deviation of the velocity", "mps"),
    Column("true_airspeed_mps", "m/s", "", "true airspeed"),
    *_vector("wind", "m/s", "runway", "true velocity of the air", "mps"),
    Column("pitot_airspeed_mps", "m/s", "", "airspeed as measured"),
    # commands and controls
    Column("command_pitch_deg", "deg", "body in runway", "pitch command"),
    Column("command_roll_deg", "deg", "body in runway", "bank command"),
    Column("command_airspeed_mps", "m/s", "", "airspeed command; NaN where the throttle is told to idle"),
    Column("elevator_deg", "deg", "", "trailing edge down positive (nose down)"),
    Column("aileron_deg", "deg", "", "positive rolls right"),
    Column("rudder_deg", "deg", "", "positive yaws right"),
    Column("throttle", "1", "", "0 to 1"),
    Column("brake", "1", "", "0 to 1"),
    Column("steering", "1", "", "-1 to 1, right positive"),
    Column("tilt_deg", "deg", "", "true mount angle of the camera, down positive"),
    Column("tilt_reading_deg", "deg", "", "the same as read"),
    Column("wow_nose", "1", "", "1 with weight on the nose wheel"),
    Column("wow_left", "1", "", "1 with weight on the left main wheel"),
    Column("wow_right", "1", "", "1 with weight on the right main wheel"),
    # the filter's health
    Column("nis", "1", "", "normalised innovation squared of this frame; NaN without a measurement"),
    Column("nis_dof", "1", "", "its degrees of freedom: 6 or 4"),
    Column("accepted", "1", "", "1 if this frame passed the gate"),
    Column("lines_found", "1", "", "lines offered to the filter, summed: 1 left edge, 2 threshold, 4 right; held"),
    Column("lines_believed", "1", "", "those that it took"),
    Column("fault", "", "", "line that is missing or another: 1 left edge, 2 threshold, 3 right; 0 none; at captures"),
    Column("lateral_protection_m", "m", "runway", "beyond which the body's lateral error has the stated risk"),
    Column("vertical_protection_m", "m", "runway", "the same of its height; both held, and NaN where none is stated"),
    Column("alarm", "", "", "landsim.state.Alarm, summed: 1 wrong line, 2 unaided, 4 inconsistent; held"),
    Column("nees9", "1", "", "normalised error squared of position, velocity and attitude; at frames"),
    Column("nees15", "1", "", "normalised error squared of all 15 states; at frames"),
    *_vector("true_gyro_bias", "deg/h", "body", "gyro bias, with what the scale factor makes of the rate", "deg_h"),
    *_vector("fused_gyro_bias", "deg/h", "body", "gyro bias by the filter", "deg_h"),
    *_vector("sigma_gyro_bias", "deg/h", "body", "its standard deviation", "deg_h"),
    *_vector("true_accel_bias", "m/s²", "body", "accelerometer bias, with what the scale factor makes of it", "mps2"),
    *_vector("fused_accel_bias", "m/s²", "body", "accelerometer bias by the filter", "mps2"),
    *_vector("sigma_accel_bias", "m/s²", "body", "its standard deviation", "mps2"),
    *_calibration(),
    # what the camera saw; NaN between frames and for a line that is not in view
    *_ends("true", "as projected and clipped, no noise"),
    *_ends("seen", "as fitted to its noisy points"),
)


def save_log(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write a log as Parquet: float64 columns in the table's order, each with its unit, frame and meaning as metadata.

    The file is written beside and then renamed.  Values come back bit for bit, NaN included.

    Parameters
    ----------
    path : Path
        The file to write.
    columns : mapping of str to (n,) array
        One array for each of ``COLUMNS``, all of one length.

    Raises
    ------
    ValueError
        If a column is missing or unknown, or its shape differs from the others'.
    """
    import pyarrow as pa

    names = [column.name for column in COLUMNS]
    for name in columns:
        if name not in names:
            raise ValueError(f"log: unknown column {name}{did_you_mean(name, names)}")
    arrays = []
    for name in names:
        if name not in columns:
            raise ValueError(f"log: column {name} is missing")
        values = np.asarray(columns[name], dtype=np.float64)
        if values.shape != (length := (len(columns[names[0]]),)):
            raise ValueError(f"log: column {name} has shape {values.shape}, {names[0]} has {length}")
        arrays.append(pa.array(values, from_pandas=False))
    fields = [
        pa.field(c.name, pa.float64(), False, {"unit": c.unit, "frame": c.frame, "description": c.what})
        for c in COLUMNS
    ]
    # Splitting floats into their bytes, not a dictionary of values, is what makes smooth signals small.
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    write_table(path, table, compression_level=6, use_dictionary=False, use_byte_stream_split=True)


def load_log(path: Path) -> Log:
    """Read a log; every column that the file has, in the file's order.

    Raises
    ------
    RunFolderError
        If the file is not there or is not Parquet.
    """
    table = read_table(path)
    return {name: table[name].to_numpy().astype(np.float64) for name in table.column_names}
