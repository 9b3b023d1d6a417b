"""What navigation and guidance are told of a scenario: what is believed, where that is not what is true."""

from copy import deepcopy

from numpy.random import SeedSequence, default_rng

from landsim.config import Scenario
from landsim.navigation import mount_of
from landsim.plugins import ControllerSetup, EstimatorSetup, refuse_bad
from landsim.scene import believed_width, incidence_of, runway_of
from landsim.sensors import camera_of, imu_noise, site_of

PLUG_INS = 0x706C7567
"""Branch of a flight's seed that the plug-ins' random numbers are from."""


def must_have_plug_ins(scenario: Scenario) -> None:
    """Refuse a scenario whose plug-ins cannot fly; InputError, as `landsim.plugins.refuse_bad`."""
    refuse_bad(scenario, *on_board(scenario, seed=0))


def on_board(scenario: Scenario, seed: int) -> tuple[EstimatorSetup, ControllerSetup]:
    """The setups of a flight.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of the flight: plug-ins that draw do so from it.
    """
    aircraft, plug_ins = scenario.aircraft_config, scenario.plug_ins
    camera, width, site = camera_of(scenario.camera), believed_width(scenario), site_of(runway_of(scenario))
    dt = 1.0 / scenario.simulation.rate_hz
    frame_dt = round(scenario.simulation.rate_hz / scenario.camera.rate_hz) * dt
    rngs = [default_rng(SeedSequence(seed, spawn_key=(PLUG_INS, i))) for i in range(2)]
    estimator = EstimatorSetup(
        camera=camera,
        noise_px=scenario.camera.noise_px,
        runway_width=width,
        site=site,
        imu=imu_noise(scenario.imu),
        imu_dt=round(scenario.simulation.rate_hz / scenario.imu.rate_hz) * dt,
        frame_dt=frame_dt,
        mount=mount_of(aircraft.mount),
        incidence=incidence_of(aircraft),
        config=scenario.navigation,
        settings=deepcopy(plug_ins.estimator_settings or {}),
        rng=rngs[0],
        latency=round(scenario.camera.latency_s * scenario.imu.rate_hz) / scenario.imu.rate_hz,
    )
    controller = ControllerSetup(
        aircraft=aircraft,
        approach=scenario.approach,
        runway_width=width,
        camera=camera,
        gravity=site.gravity,
        dt=frame_dt,
        settings=deepcopy(plug_ins.controller_settings or {}),
        rng=rngs[1],
        go_around=scenario.go_around,
    )
    return estimator, controller
