"""The inertial unit's errors against its data sheet, by the Allan deviation of IEEE Std 952.

====================  ============================================================================================
Allan deviation       the overlapping estimate of units that stand still, against N² / τ + 0.664² B² + K² τ / 3
random walks          N of angle and velocity, read at τ = 1 s from the slope -1/2
the unit              reports these errors, sample by sample, whatever the blocks in which they are drawn
the filter            takes flicker for white noise and a walk: how far off that is, by the covariance of both
====================  ============================================================================================

The numbers of the sheets stand here once more, in their own units, so that a slip in a conversion shows.
"""

import math
import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.linalg import block_diag

import landsim
from estimator.so3 import Array
from landsim.config import ImuConfig
from landsim.runway import Runway
from landsim.sensors import BLOCK, Imu, ImuErrors, flicker_sigma, imu_noise, site_of
from landsim.truth import NUMBERS, Truth

HOUR = 3600.0
DEG_H = math.radians(1.0) / HOUR
MILLI_G = 9.80665e-3


class Sheet(NamedTuple):
    """N (rad/√s, m/s/√s), floor of the Allan deviation and K √s of one kind of sensor, SI."""

    noise: float
    floor: float
    walk: float

    def deviation(self, tau: float) -> float:
        """Allan deviation at a time (s)."""
        return math.sqrt(self.noise**2 / tau + self.floor**2 + self.walk**2 * tau / 3.0)


def gyro(deg_sqrt_h: float, deg_h: float, deg_h_sqrt_h: float) -> Sheet:
    return Sheet(math.radians(deg_sqrt_h) / 60.0, deg_h * DEG_H, deg_h_sqrt_h * DEG_H / 60.0)


def accelerometer(mps_sqrt_h: float, milli_g: float, milli_g_sqrt_h: float) -> Sheet:
    return Sheet(mps_sqrt_h / 60.0, milli_g * MILLI_G, milli_g_sqrt_h * MILLI_G / 60.0)


SHEETS = {
    ("consumer", "gyro"): gyro(0.9, 20.0, 36.0),  # ICM-20948: 0.015 °/s/√Hz
    ("consumer", "accelerometer"): accelerometer(230e-6 * 9.80665 * 60.0, 0.1, 1.0),  # 230 µg/√Hz
    ("industrial", "gyro"): gyro(0.34, 8.0, 12.0),  # ADIS16470
    ("industrial", "accelerometer"): accelerometer(0.037, 0.013, 0.1),
    ("tactical", "gyro"): gyro(0.15, 0.5, 1.0),  # STIM300
    ("tactical", "accelerometer"): accelerometer(0.06, 0.05, 0.1),
}
KINDS = {"gyro": slice(0, 3), "accelerometer": slice(3, 6)}


def allan_deviation(angle: Array, steps: int, dt: float) -> float:
    """Overlapping, of what is integrated over time (n, axes), all axes together, at τ = steps dt."""
    second = angle[2 * steps :] - 2.0 * angle[steps:-steps] + angle[: -2 * steps]
    return math.sqrt(float((second**2).mean()) / 2.0) / (steps * dt)


def integrated(grade: str, rate_hz: float, every: int, hours: float, seed: int) -> Array:
    """What a unit that stands still reports beyond the truth, integrated: (n, 6), a row each `every` samples."""
    config = ImuConfig.model_validate({"grade": grade, "rate_hz": rate_hz})
    unit, increments = ImuErrors(config, default_rng(seed)), []
    block = 3600 * every
    for _ in range(round(hours * HOUR * rate_hz / block)):
        errors = unit.block(block)
        errors = errors[:, :6] / rate_hz + errors[:, 6:]
        increments.append(errors.reshape(-1, every, 6).sum(axis=1))
    return np.cumsum(np.concatenate(increments), axis=0)


@lru_cache
def measured(grade: str) -> dict[float, Array]:
    """Allan deviation (2,) of gyros and accelerometers by τ.

    Up to 5 s from half an hour at 120 Hz, beyond from ten units for six hours at 10 Hz: on three axes that is 3 % of
    the deviation at 1000 s and less before, 1/√(2 T/τ).
    """
    short = integrated(grade, 120.0, 1, 0.5, 1)
    long = [integrated(grade, 10.0, 10, 6.0, 100 + unit) for unit in range(10)]
    result = {}
    for steps in (12, 24, 60, 120, 240, 600):
        result[steps / 120.0] = np.array(
            [allan_deviation(short[:, kind], steps, 1.0 / 120.0) for kind in KINDS.values()]
        )
    for steps in (10, 20, 50, 100, 200, 500, 1000, 2000):
        squares = [[allan_deviation(unit[:, kind], steps, 1.0) ** 2 for kind in KINDS.values()] for unit in long]
        result[float(steps)] = np.sqrt(np.mean(squares, axis=0))
    return result


@pytest.mark.parametrize(("grade", "kind"), SHEETS)
def test_allan_deviation_is_that_of_the_sheet(grade: str, kind: str) -> None:
    sheet, row = SHEETS[grade, kind], list(KINDS).index(kind)
    table = {tau: float(both[row]) for tau, both in measured(grade).items()}
    unit, name = (DEG_H, "deg/h") if kind == "gyro" else (MILLI_G, "mg")
    for tau, value in table.items():
        stated = sheet.deviation(tau)
        both = f"measured {value / unit:8.4f} stated {stated / unit:8.4f} {name}"
        print(f"{grade:10} {kind:13} {tau:6g} s {both} {value / stated - 1.0:+.1%}")
    # read as from a sheet's plot: the line of slope -1/2 through the short times, at 1 s
    noise = np.mean([value * math.sqrt(tau) for tau, value in table.items() if tau <= 0.5])
    assert noise == pytest.approx(sheet.noise, rel=0.1)
    for tau, value in table.items():
        assert value == pytest.approx(sheet.deviation(tau), rel=0.1), tau
    # and each of the three parts shows: without it the curve would be off by more than that somewhere
    for part in Sheet._fields:
        without = sheet._replace(**{part: 0.0})
        assert max(value / without.deviation(tau) for tau, value in table.items()) > 1.1, part


@pytest.mark.parametrize(("grade", "kind"), SHEETS)
def test_allan_deviations_on_the_page_are_those_measured(grade: str, kind: str) -> None:
    page = (Path(landsim.__file__).parents[1] / "docs/sensors.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| {grade} \| {kind}, (\S+) \| (.*) \|$", page, re.MULTILINE)
    unit = {"°/h": DEG_H, "mg": MILLI_G}[row[0]]
    for cell, tau in zip(row[1].split(" | "), (0.1, 1.0, 10.0, 100.0, 1000.0), strict=True):
        found, stated = (float(number) for number in cell.rstrip(")").split(" ("))
        assert found == pytest.approx(measured(grade)[tau][list(KINDS).index(kind)] / unit, rel=0.01)
        assert stated == pytest.approx(SHEETS[grade, kind].deviation(tau) / unit, rel=0.005)


def test_the_unit_reports_these_errors() -> None:
    """Standing still, three blocks long: with scale factors of zero nothing else."""
    motion = np.zeros(NUMBERS)
    motion[[6, 10, 14]] = 1.0
    still, site = Truth(0.0, motion, 0.0), site_of(Runway(2000.0, 30.0, latitude=0.8))
    config = ImuConfig.model_validate({"grade": "industrial", "scale_factor": 0.0})
    perfect = dict.fromkeys((k for k in ImuConfig.model_fields if k not in ("rate_hz", "grade")), 0.0)
    unit, ideal = (Imu(c, site, still, default_rng(6)) for c in (config, ImuConfig.model_validate(perfect)))
    source = ImuErrors(config, default_rng(6))
    errors = np.concatenate([source.block(BLOCK) for _ in range(3)])
    off = np.array([unit.sample(still) - ideal.sample(still) for _ in range(3 * BLOCK)])
    np.testing.assert_allclose(off, errors[:, :6] / 120.0 + errors[:, 6:], atol=1e-12)
    np.testing.assert_allclose(unit.errors(), errors[-1, :6], atol=1e-12)


TIMES = 0.05 * 2.0 ** np.arange(19)
"""Correlation times of a flicker made for the test, s: denser than the unit's own, and over more decades."""


def normalised_squares(
    sheet: Sheet, believed: tuple[float, float, float], bias: float, order: int, sigma: float
) -> Array:
    """Expected squares over the variances that a filter believes, after 50 s: of what it measures, and of the bias.

    One axis, of which an angle (order 1) or a place (order 2) is measured 30 times a second and the unit's error is the
    rate or the acceleration.  The filter has a bias that walks, the truth a walk and flicker; the covariance of both
    together is carried on (Maybeck, Stochastic Models, Estimation, and Control, vol. 1, section 6.8).

    Parameters
    ----------
    sheet : Sheet
        What is true.
    believed : (3,) float
        The filter's white noise, walk of the bias and its standard deviation at the start.
    bias : float
        1 σ of the true one, without flicker.
    order : {1, 2}
    sigma : float
        Of a measurement.
    """
    dt, flicker = 1.0 / 30.0, (sheet.floor / 0.664) ** 2 * math.log(2.0) / math.pi
    decay = np.exp(-dt / TIMES)
    white = np.array(((dt,),)) if order == 1 else np.array(((dt**3 / 3.0, dt**2 / 2.0), (dt**2 / 2.0, dt)))

    def moved(biases: int) -> Array:
        F = np.eye(order + biases)
        F[order - 1, order:] = dt
        if order == 2:
            F[0, 1], F[0, 2:] = dt, dt**2 / 2.0
        return F

    first = (0.01**2,) if order == 1 else (3.0**2, 0.2**2)
    F, Q = moved(1), block_diag(believed[0] ** 2 * white, believed[1] ** 2 * dt)
    P = np.diag((*first, believed[2] ** 2))
    true_F = moved(1 + TIMES.size)
    true_F[order + 1 :, order + 1 :] = np.diag(decay)
    true_F[order - 1, order + 1 :] = TIMES * (1.0 - decay)  # its mean over the interval
    true_Q = block_diag(sheet.noise**2 * white, sheet.walk**2 * dt, np.diag(flicker * (1.0 - decay**2)))
    n, both = order + 1, order + 1 + true_F.shape[0]
    joint = np.zeros((both, both))
    joint[n:, n:] = np.diag((*first, bias**2, *[flicker] * TIMES.size))
    total = np.zeros((n, both - n))  # what of the truth the filter estimates
    total[:order, :order] = np.eye(order)
    total[order, order:] = 1.0
    h = np.eye(n)[:1]
    for _ in range(1500):
        A = block_diag(F, true_F)
        joint = A @ joint @ A.T
        joint[n:, n:] += true_Q
        P = F @ P @ F.T + Q
        gain = P @ h.T / (h @ P @ h.T + sigma**2)
        C = np.eye(both)
        C[:n, :n], C[:n, n:] = np.eye(n) - gain @ h, gain @ h @ total
        joint = C @ joint @ C.T
        joint[:n, :n] += sigma**2 * gain @ gain.T
        P = (np.eye(n) - gain @ h) @ P
    E = np.hstack((-np.eye(n), total))
    error = E @ joint @ E.T
    leading = np.trace(np.linalg.solve(P[:order, :order], error[:order, :order])) / order
    return np.array((leading, error[order, order] / P[order, order]))


@pytest.mark.parametrize("kind", ["gyro", "accelerometer"])
def test_what_stands_for_flicker_is_near_its_floor(kind: str) -> None:
    floor = 6.64  # of B = 10
    flicker = {"gyro_bias_instability_deg_h": 10.0, "accel_bias_instability_mg": 10.0}
    silent = {k: 0.0 for k in ImuConfig.model_fields if "noise" in k or "drift" in k}
    noise = imu_noise(ImuConfig.model_validate({**silent, **flicker}))
    per_hour, mg = math.radians(1.0) / 3600.0, 9.80665e-3
    N, K = (noise.gyro / per_hour, noise.gyro_drift / per_hour) if kind == "gyro" else (
        noise.accel / mg, noise.accel_drift / mg
    )  # fmt: skip
    tau = np.geomspace(0.1, 250.0, 200)
    deviation = np.sqrt(N**2 / tau + K**2 * tau / 3.0)
    assert deviation.min() == pytest.approx(math.sqrt(0.7) * floor, rel=1e-3)
    assert tau[deviation.argmin()] == pytest.approx(5.0, rel=0.05)


# of a frame's attitude, rad, and of its place, m: far from the threshold and near it
MEASURED = {"gyro": (1, (2e-3, 3e-4)), "accelerometer": (2, (1.0, 0.1))}


@pytest.mark.parametrize(("grade", "kind"), SHEETS)
def test_flicker_as_the_filter_takes_it(grade: str, kind: str) -> None:
    """Angle, place and velocity are as uncertain as it says to 5 % of their σ, the bias at most 1.8 times as much.

    The fast part of the flicker counts as bias too, and nothing could follow it.
    """
    config = ImuConfig.model_validate({"grade": grade, "scale_factor": 0.0})
    noise, sheet = imu_noise(config), SHEETS[grade, kind]
    spread = flicker_sigma(sheet.floor / 0.664)
    believed = (
        (noise.gyro, noise.gyro_drift, noise.gyro_bias)
        if kind == "gyro"
        else (noise.accel, noise.accel_drift, noise.accel_bias)
    )
    order, sigmas = MEASURED[kind]
    for sigma in sigmas:
        squares = normalised_squares(sheet, believed, math.sqrt(believed[2] ** 2 - spread**2), order, sigma)
        assert 0.95**2 < squares[0] < 1.05**2
        assert 0.9**2 < squares[1] < 1.8**2
