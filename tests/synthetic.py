"""A flight without a simulator: a log of the right columns and a plausible course, for the tests of what reads logs."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landsim.config import (
    ApproachConfig,
    BoxConfig,
    CameraConfig,
    FaultConfig,
    GearConfig,
    GoAroundConfig,
    NavigationConfig,
    RunwayConfig,
    SimulationConfig,
)
from landsim.log import COLUMNS, ENDS, LINES, QUANTITIES

Array = NDArray[np.float64]
STEP = 1.0 / 120.0
EVERY = 4
"""Steps a frame."""
FOCAL_PX, WIDTH_PX, HEIGHT_PX = 12.5e-3 / 9.9e-6, 658, 494


def empty_log(rows: int) -> dict[str, Array]:
    """All columns, zero, but NaN in what only a camera frame or a filter gives."""
    log: dict[str, Array] = {column.name: np.zeros(rows) for column in COLUMNS}
    for name, values in log.items():
        if name.startswith(
            ("vision_", "fused_", "sigma_", "nis", "nees", "accepted", "fault", *LINES)
        ) or name.endswith("_protection_m"):
            values[:] = math.nan
    log["time_s"] = STEP * np.arange(rows, dtype=float)
    return log


def flight_log(rng: np.random.Generator) -> dict[str, Array]:
    """A 3° glide from 1000 m, a flare, a touchdown near 200 m and a rollout to a stop, with plausible noise."""
    log = empty_log(6000)
    _motion(log)
    n = log["time_s"].size
    frames = np.arange(n) % EVERY == 0
    _camera(log, frames, rng)
    _navigation(log, frames, rng)
    return log


def _motion(log: dict[str, Array]) -> None:
    x, height, vx, vz = -1000.0, 60.0, 39.95, -2.094
    touched = None
    n = log["time_s"].size
    stopped = n
    for i in range(n):
        t = log["time_s"][i]
        wheel = height - 0.84
        phase = 1 if wheel > 7.0 else 2
        if touched is None and phase == 2:
            vz += STEP / 0.3 * (-(wheel + 2.0) / 4.0 - vz)
            vx -= 0.8 * STEP
        if touched is None and wheel <= 0.0:
            touched = t
        if touched is not None:
            phase, vz, height = 3, 0.0, 0.84 - 0.03
            vx -= (1.0 if t < touched + 2.0 else 3.5) * STEP
            if vx < 0.3:
                phase, vx = 4, 0.2
        log["phase"][i] = phase if t > 0.5 else 0
        log["body_x_m"][i], log["body_height_m"][i] = x, height
        log["wheel_height_m"][i] = height - 0.84
        log["true_velocity_x_mps"][i], log["true_velocity_z_mps"][i] = vx, -vz
        pitch = -0.3 if phase < 2 else 2.6
        if touched is not None:
            pitch = max(2.6 - 2.5 * (t - touched), 0.0)
            log["wow_left"][i] = log["wow_right"][i] = 1.0
            log["wow_nose"][i] = float(pitch == 0.0)
            log["brake"][i] = 0.5 if t > touched + 2.0 else 0.0
            log["steering"][i] = 0.05 * math.sin(t)
        log["command_pitch_deg"][i] = pitch
        log["throttle"][i] = 0.45 if phase < 2 else 0.0
        log["tilt_deg"][i] = 10.0 if x > -40.0 and touched is None else 3.0
        x, height = x + vx * STEP, height + vz * STEP
        if phase == 4:
            stopped = i + 1
            break
    for name in log:
        log[name] = log[name][:stopped]
    t = log["time_s"]
    decay = np.exp(-t / 8.0)
    log["body_y_m"] = 8.0 * decay * np.cos(t / 5.0)
    log["true_velocity_y_mps"] = np.gradient(log["body_y_m"], STEP)
    log["body_roll_deg"] = 4.0 * decay * np.sin(t / 3.0)
    log["body_yaw_deg"] = 2.0 * decay * np.cos(t / 4.0)
    kernel = np.ones(60) / 60.0
    padded = np.concatenate([np.full(59, log["command_pitch_deg"][0]), log["command_pitch_deg"]])
    log["body_pitch_deg"] = np.convolve(padded, kernel, "valid")
    log["command_roll_deg"] = log["body_roll_deg"] + 0.5 * np.sin(2.0 * t) * decay
    log["true_airspeed_mps"] = log["true_velocity_x_mps"].copy()
    log["pitot_airspeed_mps"] = log["true_airspeed_mps"] + 0.3 * np.sin(37.0 * t)
    log["command_airspeed_mps"] = np.where(log["phase"] == 1, 40.0, math.nan)
    log["elevator_deg"] = -3.0 + 0.5 * np.sin(t)
    log["aileron_deg"] = np.cos(t) * decay
    log["rudder_deg"] = 0.5 * np.sin(t / 2.0) * decay
    log["tilt_reading_deg"] = log["tilt_deg"].copy()
    log["true_along_m"] = log["body_x_m"] + 1.0
    log["true_cross_m"] = log["body_y_m"].copy()
    log["true_height_m"] = log["body_height_m"] + 0.1
    log["true_roll_deg"] = log["body_roll_deg"].copy()
    log["true_pitch_deg"] = log["body_pitch_deg"] - log["tilt_deg"]
    log["true_yaw_deg"] = log["body_yaw_deg"].copy()


def _camera(log: dict[str, Array], frames: NDArray[np.bool_], rng: np.random.Generator) -> None:
    corners = {
        "left": ((0.0, -15.0), (2000.0, -15.0)),
        "threshold": ((0.0, -15.0), (0.0, 15.0)),
        "right": ((0.0, 15.0), (2000.0, 15.0)),
    }
    for i in np.flatnonzero(frames):
        pose = [float(log[f"true_{q}"][i]) for q in QUANTITIES]
        seen = 0
        for line, ends in corners.items():
            segment = _projected(pose, *ends)
            if segment is None:
                continue
            seen += 1
            noisy = segment + rng.normal(0.0, 0.4, 4)
            for j, end in enumerate(ENDS):
                log[f"{line}_true_{end}"][i], log[f"{line}_seen_{end}"][i] = segment[j], noisy[j]
        log["stage"][i : i + EVERY] = {3: 1, 2: 2}.get(seen, 0)


def _projected(pose: list[float], start: tuple[float, float], end: tuple[float, float]) -> Array | None:
    """A painted line in the image: points along it that fall inside, the first and the last."""
    along, cross, height = pose[:3]
    roll, pitch, yaw = np.radians(pose[3:])
    s = np.concatenate([np.linspace(0.0, 0.1, 2000), np.linspace(0.1, 1.0, 1000)])
    dx = start[0] + s * (end[0] - start[0]) - along
    dy = start[1] + s * (end[1] - start[1]) - cross
    dz = np.full_like(s, height)
    dx, dy = math.cos(yaw) * dx + math.sin(yaw) * dy, -math.sin(yaw) * dx + math.cos(yaw) * dy
    dx, dz = math.cos(pitch) * dx - math.sin(pitch) * dz, math.sin(pitch) * dx + math.cos(pitch) * dz
    dy, dz = math.cos(roll) * dy + math.sin(roll) * dz, -math.sin(roll) * dy + math.cos(roll) * dz
    ahead = dx > 1.0
    u = np.where(ahead, FOCAL_PX * dy / np.where(ahead, dx, 1.0) + 0.5 * (WIDTH_PX - 1), -1e9)
    v = np.where(ahead, FOCAL_PX * dz / np.where(ahead, dx, 1.0) + 0.5 * (HEIGHT_PX - 1), -1e9)
    inside = np.flatnonzero((u >= -0.5) & (u <= WIDTH_PX - 0.5) & (v >= -0.5) & (v <= HEIGHT_PX - 0.5))
    if inside.size < 2:
        return None
    a, b = inside[0], inside[-1]
    segment = np.array([u[a], v[a], u[b], v[b]])
    return segment if math.hypot(segment[2] - segment[0], segment[3] - segment[1]) >= 8.0 else None


def _navigation(log: dict[str, Array], frames: NDArray[np.bool_], rng: np.random.Generator) -> None:
    t, n = log["time_s"], log["time_s"].size
    distance = np.maximum(np.abs(log["true_along_m"]), 60.0)
    relative = distance / 1000.0
    vision_sigma = {
        "along_m": 15.0 * relative**1.9, "cross_m": 1.4 * relative**1.6, "height_m": 2.3 * relative**1.8,
        "roll_deg": 1.2 * relative**1.5, "pitch_deg": 0.09 * relative, "yaw_deg": 0.07 * relative,
    }  # fmt: skip
    early, late = log["stage"] == 1, log["stage"] == 2
    running = t > 0.5
    on_ground = log["phase"] >= 3
    since = np.where(on_ground, t - t[on_ground][0], 0.0) if on_ground.any() else np.zeros(n)
    drift = np.convolve(rng.normal(0.0, 1.0, n + 599), np.ones(600) / math.sqrt(600.0), "valid")
    for quantity, sigma in vision_sigma.items():
        seen = frames & (early | (late & (quantity not in ("along_m", "roll_deg"))))
        fused_sigma = 0.15 * sigma + (0.05 * since if quantity == "along_m" else 0.0)
        truth = log[f"true_{quantity}"]
        log[f"vision_{quantity}"] = np.where(seen, truth + rng.normal(0.0, 1.0, n) * sigma, math.nan)
        log[f"fused_{quantity}"] = np.where(running, truth + np.roll(drift, rng.integers(n)) * fused_sigma, math.nan)
        log[f"sigma_{quantity}"] = np.where(running, fused_sigma, math.nan)
    measured = frames & running & (log["stage"] > 0)
    log["nis_dof"] = np.where(measured, np.where(log["stage"] == 1, 6.0, 4.0), math.nan)
    log["lines_found"] = np.where(measured, np.where(log["stage"] == 1, 7.0, 5.0), 0.0)
    log["nis"] = np.where(measured, rng.chisquare(np.where(log["stage"] == 1, 6.0, 4.0)), math.nan)
    log["accepted"] = np.where(measured, 1.0, math.nan)
    log["nees9"] = np.where(frames & running, rng.chisquare(9.0, n), math.nan)
    log["nees15"] = np.where(frames & running, rng.chisquare(15.0, n), math.nan)


def parts() -> tuple[Any, Any]:
    """What the metrics and the pictures read of a scenario and an aircraft: sections of the right models."""
    scenario = SimpleNamespace(
        name="landing",
        runway=RunwayConfig(width_m=30.0, length_m=2000.0),
        approach=ApproachConfig(glide_slope_deg=3.0, aim_point_m=145.0),
        camera=CameraConfig(width_px=WIDTH_PX, height_px=HEIGHT_PX),
        fault=FaultConfig(),
        go_around=GoAroundConfig(),
        navigation=NavigationConfig(gate_early=22.5, gate_late=18.5),
        simulation=SimulationConfig(time_limit_s=120.0),
        box=BoxConfig(
            along_min_m=100.0,
            along_max_m=450.0,
            cross_max_m=2.0,
            sink_max_mps=1.0,
            bank_max_deg=3.0,
            stop_cross_max_m=3.0,
        ),
    )
    gear = GearConfig(
        nose_wheel_body_m=(1.2192, 0.0, 0.8382),
        left_wheel_body_m=(-0.2794, -0.762, 0.8382),
        right_wheel_body_m=(-0.2794, 0.762, 0.8382),
        sink_limit_mps=3.0,
    )
    aircraft = SimpleNamespace(name="pioneer", gear=gear)
    scenario.aircraft_config = aircraft
    return scenario, aircraft
