"""Inertial units by grade: what is bought under the name, 1 σ, as the keys of ``[imu]``.

Noise and in-run bias instability are a representative unit's data sheet, typical values: TDK InvenSense ICM-20948
(consumer), Analog Devices ADIS16470 (industrial), Sensonor STIM300 with 10 g accelerometers (tactical).  A sheet's
instability is the floor of the Allan deviation, so that B is that over 0.664.  ESTIMATES, since sheets give ranges over
temperature or nothing: what the biases are after power-up, less what a calibration on the ground takes off; scale
factors; random walks of the bias, set to pass the instability after about an hour; the consumer unit's instabilities.
"""

FLOOR = 0.664
"""sqrt(2 ln 2 / π): floor of the Allan deviation over B."""

GRADES: dict[str, dict[str, float]] = {
    "consumer": {
        "gyro_bias_deg_h": 360.0,  # 0.1 deg/s
        "gyro_bias_drift_deg_h_sqrt_h": 36.0,
        "gyro_noise_deg_sqrt_h": 0.9,  # 0.015 deg/s/√Hz
        "gyro_bias_instability_deg_h": 20.0 / FLOOR,
        "accel_bias_mg": 10.0,
        "accel_bias_drift_mg_sqrt_h": 1.0,
        "accel_noise_mps_sqrt_h": 0.135,  # 230 µg/√Hz
        "accel_bias_instability_mg": 0.1 / FLOOR,
        "scale_factor": 5e-3,
    },
    "industrial": {
        "gyro_bias_deg_h": 100.0,
        "gyro_bias_drift_deg_h_sqrt_h": 12.0,
        "gyro_noise_deg_sqrt_h": 0.34,
        "gyro_bias_instability_deg_h": 8.0 / FLOOR,
        "accel_bias_mg": 3.5,
        "accel_bias_drift_mg_sqrt_h": 0.1,
        "accel_noise_mps_sqrt_h": 0.037,
        "accel_bias_instability_mg": 0.013 / FLOOR,
        "scale_factor": 1e-3,
    },
    "tactical": {
        "gyro_bias_deg_h": 10.0,
        "gyro_bias_drift_deg_h_sqrt_h": 1.0,
        "gyro_noise_deg_sqrt_h": 0.15,
        "gyro_bias_instability_deg_h": 0.5 / FLOOR,
        "accel_bias_mg": 2.0,
        "accel_bias_drift_mg_sqrt_h": 0.1,
        "accel_noise_mps_sqrt_h": 0.06,
        "accel_bias_instability_mg": 0.05 / FLOOR,
        "scale_factor": 5e-4,
    },
}
