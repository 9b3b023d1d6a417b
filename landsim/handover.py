"""The state that a GNSS/INS approach hands over to the filter: the truth, off by what its covariance says."""

import numpy as np
from numpy.random import Generator

from estimator.alignment import Start
from estimator.strapdown import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    STATES,
    VELOCITY,
    ImuNoise,
    corrected,
    inertial,
)
from landsim.config import NavigationConfig
from landsim.truth import MOTION, Truth
from landsim.units import DEG


def handed_over(truth: Truth, config: NavigationConfig, imu: ImuNoise, rng: Generator) -> Start:
    """State and covariance with which the filter starts.

    Parameters
    ----------
    truth : Truth
        At the start.
    config : NavigationConfig
        Its ``handover_*`` are the standard deviations; roll and pitch count as turns about the runway's axes x and y.
    imu : ImuNoise
        The biases are as unknown as the data sheet says.
    rng : Generator
    """
    sigma = np.zeros(STATES)
    sigma[POSITION] = config.handover_along_sigma_m, config.handover_cross_sigma_m, config.handover_height_sigma_m
    sigma[VELOCITY] = config.handover_velocity_sigma_mps
    level = config.handover_attitude_sigma_deg * DEG
    sigma[ATTITUDE] = level, level, config.handover_heading_sigma_deg * DEG
    sigma[GYRO_BIAS], sigma[ACCEL_BIAS] = imu.gyro_bias, imu.accel_bias
    off = np.zeros(STATES)
    off[: GYRO_BIAS.start] = -sigma[: GYRO_BIAS.start] * rng.standard_normal(GYRO_BIAS.start)
    nominal = np.append(truth.motion[:MOTION], np.zeros(3))
    return Start(inertial(corrected(nominal, off)), np.diag(sigma**2))
