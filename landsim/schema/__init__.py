"""What a scenario file and an aircraft file may hold: frozen models, with the default and the range of every key.

The models are the reference of the keys: a section of the file is a model, a key is a field, and the text under a field
says what it means.  Keys carry their unit.  Unknown keys, values of another type (whole numbers stand for floats,
nothing else is converted), NaN and infinities are refused.

::

    base         the frozen model, common ranges, a model's keys by name
    flight       aircraft, runway, approach, start, wind, loading, simulation, box
    sensors      camera, inertial unit, pitot tube, navigation
    plug_ins     estimator and controller of others
    study        studies and their bounds
    dispersions  what is drawn for each flight
    drawn        which keys may be drawn, and whether what is drawn is allowed
    aircraft     an aircraft's file
    scenario     a scenario: its sections, and what they have to agree on
"""

from landsim.schema.aircraft import (
    AircraftConfig,
    AircraftFile,
    ApproachGains,
    ClimbGains,
    FlareGains,
    GearConfig,
    GuidanceConfig,
    MountConfig,
    RolloutGains,
    SpeedsConfig,
    WindGains,
)
from landsim.schema.base import LARGEST, Section, field_names, fields_by_key, rows
from landsim.schema.dispersions import CorrelationConfig, DispersionsConfig, DrawConfig
from landsim.schema.drawn import SPREAD_BY_SEED, applied, drawable, refusal, value_of, with_values
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
from landsim.schema.plug_ins import OWN, PlugInsConfig
from landsim.schema.scenario import Scenario, ScenarioFile
from landsim.schema.sensors import CameraConfig, FaultConfig, ImuConfig, NavigationConfig, PitotConfig
from landsim.schema.study import BoundsConfig, StudyConfig

__all__ = [
    "LARGEST",
    "OWN",
    "SPREAD_BY_SEED",
    "AirConfig",
    "AircraftChoice",
    "AircraftConfig",
    "AircraftFile",
    "ApproachConfig",
    "ApproachGains",
    "BoundsConfig",
    "BoxConfig",
    "CameraConfig",
    "ClimbGains",
    "CorrelationConfig",
    "DispersionsConfig",
    "DrawConfig",
    "FaultConfig",
    "FlareGains",
    "GearConfig",
    "GoAroundConfig",
    "GuidanceConfig",
    "GustConfig",
    "ImuConfig",
    "LoadingConfig",
    "MountConfig",
    "NavigationConfig",
    "PitotConfig",
    "PlugInsConfig",
    "RolloutGains",
    "RunwayConfig",
    "Scenario",
    "ScenarioFile",
    "Section",
    "SimulationConfig",
    "SpeedsConfig",
    "StartConfig",
    "StudyConfig",
    "TurbulenceConfig",
    "WindConfig",
    "WindGains",
    "applied",
    "drawable",
    "field_names",
    "fields_by_key",
    "refusal",
    "rows",
    "value_of",
    "with_values",
]
