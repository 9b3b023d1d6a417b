"""Vision-guided landings in JSBSim: what steers the aircraft sees a camera's runway lines, an IMU and a pitot tube.

::

    scenario = landsim.load_scenario("landing", overrides={"runway.width_m": 45.0})
    flight = landsim.fly(scenario, seed=7)
    flight.metrics["outcome"]  # as in metrics.json
    flight.log["fused_cross_m"]  # as in log.parquet; landsim.log.COLUMNS says what there is

Conventions
-----------
Frames, signs and the naming of transforms are those of the estimator, stated once, in ``estimator/__init__.py``.  Here
the same, and what the simulation adds:

- SI units and radians everywhere inside, without a suffix.  Anything else carries its unit in the name (``_deg``,
  ``_ft``, ``_kt``, ``_px``), and so does every key of a file and every column of a log.
- *runway*: origin at the middle of the threshold, x along the centreline in the landing direction, y right, z down;
  fixed to the Earth.  A log's ``along`` is x, ``cross`` is y and ``height`` is -z.
- *body*: forward, right, down from the nominal centre of gravity.  Roll is positive right side down, pitch nose up,
  yaw nose right; Euler angles (z-y-x) appear at the edges only.
- Elevator: trailing edge down is positive (nose down).  Aileron and rudder: positive rolls and yaws right.
- What is true is in ``landsim.truth``, what is known on board in ``landsim.state``.  Guidance and navigation cannot
  import the truth.
- Everything random comes from one seed.  The same seed on the same machine gives the same bits.

Modules
-------
A module imports from those below it only; a contract in the checks holds this.

===================================  ==================================================================================
``cli``, ``terminal``                parse arguments and print; ``tables`` are those at the end of what was done
``report``, ``plots``                pictures; the only ones that import matplotlib
``page``                             the report as one HTML file and as Markdown
``charts``                           what the figures of a batch show, as data, from its summary alone
``runs``                             run folders, written whole or not at all
``budget``                           the line precision that bounds ask for, and the ranges from which they hold
``study``                            errors by range, sampled and flown, against a paper's bounds
``batch``                            many flights: rows, the engine, statistics, comparison
``simulate``, ``recorder``           the loop and what it keeps: the only ones that hold truth and navigation both
``plugins``                          estimators and controllers of others: found, made, guarded; what they import
``onboard``                          what navigation and guidance are told of a scenario
``modes``                            the aircraft's modes, from JSBSim's own linearisation
``dispersion``                       what a scenario's dispersions draw for each flight
``plant``, ``atmosphere``            JSBSim, the only one that imports it: feet, slugs and degrees end here; the wind
``sensors``, ``camera_errors``       truth to measurements: camera lines, one IMU, pitot; a camera as it is bought
``navigation``, ``integrity``        drives the estimator and its filter; what it says of its own integrity
``handover``                         the state that a GNSS/INS approach hands over
``guidance``                         phases and commands, from the navigation state alone
``go_around``, ``wind_law``          when a landing is given up; what is flown besides in wind
``omniscient``                       the true state in place of navigation's, for comparison
``metrics``                          log to touchdown, tracking, navigation errors; pure
``alarms``                           what navigation stated of itself, beside what was true; pure
``scene``                            from a scenario's settings to its runway and its aircraft's incidence
``config``, ``schema``               TOML to frozen, validated models
``resources``                        finds the shipped aircraft and scenarios
``log``, ``parquet``                 the table of columns; tables as files
``state``, ``truth``                 what is known on board; what is true
``runway``, ``attitude``             the runway on the Earth; attitude in its frame
``earth``, ``errors``, ``plain``     WGS 84; one-line errors; values as JSON has them
``units``, ``threads``               every conversion factor; how matrix libraries take their number of threads
``versions``                         those that decide the bits of a result
===================================  ==================================================================================
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from landsim.config import load_scenario
    from landsim.simulate import fly

__version__ = "0.1.0"
__all__ = ["__version__", "fly", "load_scenario"]


def __getattr__(name: str) -> Any:
    # Imported when asked for: the command line's help and list must not wait for numpy, pydantic and JSBSim.
    if name == "load_scenario":
        from landsim.config import load_scenario

        return load_scenario
    if name == "fly":
        from landsim.simulate import fly

        return fly
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
