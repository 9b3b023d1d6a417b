"""A scenario: its sections, and what they have to agree on."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from landsim.schema.aircraft import AircraftConfig
from landsim.schema.base import Section, refused
from landsim.schema.dispersions import DispersionsConfig
from landsim.schema.drawn import check_draw
from landsim.schema.flight import (
    AirConfig,
    AircraftChoice,
    ApproachConfig,
    BoxConfig,
    GoAroundConfig,
    GustConfig,
    LoadingConfig,
    RunwayConfig,
    SimulationConfig,
    StartConfig,
    TurbulenceConfig,
    WindConfig,
)
from landsim.schema.plug_ins import PlugInsConfig
from landsim.schema.sensors import CameraConfig, FaultConfig, ImuConfig, NavigationConfig, PitotConfig
from landsim.schema.study import StudyConfig

HIDDEN = (
    ("camera", "focal_length_error", 0.0),
    ("camera", "tilt_error_deg", 0.0),
    ("camera", "noise_factor", 1.0),
    ("camera", "pan_error_deg", 0.0),
    ("camera", "roll_error_deg", 0.0),
    ("camera", "principal_u_error_px", 0.0),
    ("camera", "principal_v_error_px", 0.0),
    ("camera", "radial_distortion", 0.0),
    ("runway", "width_error_m", 0.0),
)
"""Errors of the camera and the runway that navigation is not told of, and the values of none."""


class ScenarioFile(Section):
    """Everything that a scenario file may say."""

    kind: Literal["flight", "study"]
    aircraft: AircraftChoice
    runway: RunwayConfig = Field(default_factory=RunwayConfig)
    approach: ApproachConfig = Field(default_factory=ApproachConfig)
    start: StartConfig = Field(default_factory=StartConfig)
    wind: WindConfig = Field(default_factory=WindConfig)
    turbulence: TurbulenceConfig = Field(default_factory=TurbulenceConfig)
    gust: GustConfig = Field(default_factory=GustConfig)
    air: AirConfig = Field(default_factory=AirConfig)
    loading: LoadingConfig = Field(default_factory=LoadingConfig)
    camera: CameraConfig = Field(default_factory=CameraConfig)
    fault: FaultConfig = Field(default_factory=FaultConfig)
    imu: ImuConfig = Field(default_factory=ImuConfig)
    pitot: PitotConfig = Field(default_factory=PitotConfig)
    navigation: NavigationConfig = Field(default_factory=NavigationConfig)
    go_around: GoAroundConfig = Field(default_factory=GoAroundConfig)
    simulation: SimulationConfig = Field(default_factory=SimulationConfig)
    box: BoxConfig = Field(default_factory=BoxConfig)
    plug_ins: PlugInsConfig = Field(default_factory=PlugInsConfig, alias="plug-ins")
    study: StudyConfig | None = None
    """Of the kind ``study`` alone."""
    dispersions: DispersionsConfig | None = None
    """Of the kind ``flight`` alone."""

    @model_validator(mode="after")
    def _sections_agree(self) -> Self:
        if (self.kind == "study") != (self.study is not None):
            wanted = "is missing, which" if self.study is None else "belongs to"
            raise refused(f'{wanted} kind = "study"{" needs" if self.study is None else ""}', "study")
        step_rate = self.simulation.rate_hz
        for key, rate in (("imu.rate_hz", self.imu.rate_hz), ("camera.rate_hz", self.camera.rate_hz)):
            steps = step_rate / rate
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
                raise refused(f"must divide simulation.rate_hz = {step_rate:g}; {rate:g} does not", key)
        frames = self.imu.rate_hz / self.camera.rate_hz
        if round(frames) < 1 or abs(frames - round(frames)) > 1e-9 * frames:
            raise refused(
                f"must divide imu.rate_hz = {self.imu.rate_hz:g}; {self.camera.rate_hz:g} does not", "camera.rate_hz"
            )
        if self.approach.aim_point_m >= self.runway.length_m:
            length, aim_point = self.runway.length_m, self.approach.aim_point_m
            raise refused(f"must be below runway.length_m = {length:g}, not {aim_point:g}", "approach.aim_point_m")
        late, unaided = self.camera.latency_s, self.navigation.unaided_s
        if self.navigation.aiding == "lines" and late >= unaided:
            told = f"must be below navigation.unaided_s = {unaided:g}, or every frame comes too late; not {late:g}"
            raise refused(told, "camera.latency_s")
        return self

    @model_validator(mode="after")
    def _samples_have_no_hidden_errors(self) -> Self:
        if self.study is None or self.study.method != "sampling":
            return self
        for section, name, nominal in HIDDEN:
            if getattr(getattr(self, section), name) != nominal:
                told = f'must be {nominal:g} in a study of method = "sampling": its frames know nothing of it'
                raise refused(told, f"{section}.{name}")
        return self

    @model_validator(mode="after")
    def _draws_can_be_used(self) -> Self:
        if self.dispersions is None:
            return self
        if self.kind != "flight":
            raise refused('belongs to kind = "flight"', "dispersions")
        drawn = {draw.key for draw in self.dispersions.draw}
        for i, draw in enumerate(self.dispersions.draw):
            check_draw(self, draw, f"dispersions.draw[{i}]", drawn)
        return self


class Scenario(ScenarioFile):
    """A scenario as loaded, with its aircraft; complete, so that a flight needs nothing else but a seed."""

    name: str
    """The file's name without its ending."""
    path: Path
    """The file it was read from, absolute."""
    aircraft_config: AircraftConfig
