"""A batch in numbers: everything that its report shows, as ``summary.json`` has it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from landsim.batch.flights import Flights
from landsim.batch.sections.consistency import consistency
from landsim.batch.sections.distributions import distributions
from landsim.batch.sections.envelopes import envelopes
from landsim.batch.sections.rates import rates
from landsim.batch.sections.sensitivity import sensitivity
from landsim.batch.sections.touchdown import touchdown
from landsim.batch.sections.tracking import tracking
from landsim.batch.sections.verdict import verdict
from landsim.batch.sections.words import span_of
from landsim.batch.sections.worst import worst
from landsim.batch.stats import CONFIDENCE
from landsim.config import Scenario
from landsim.plain import as_json

FORMAT = 2
"""Of the summary; another one has other keys."""


def summarise(scenario: Scenario, flights: Flights, identity: Mapping[str, Any]) -> dict[str, Any]:
    """All numbers of a batch's report.

    Parameters
    ----------
    scenario : Scenario
        Of the batch, with its dispersions.
    flights : Flights
        Any number of them, with any outcome.
    identity : mapping
        Of the batch, as in batch.json: ``scenario``, ``n``, ``seed`` and ``versions`` are taken from it, and where they
        are given ``sampling``, ``shard``, ``engine``, ``workers`` and ``wall_time_s``.

    Returns
    -------
    dict
        As JSON has it: what a batch does not show is None.  The same flights make the same summary but for ``engine``,
        ``workers`` and wall times.  Distances are m to the threshold, falling.  A *rate* is ``count``, ``n``, ``rate``,
        ``low``, ``high``.

        ========================  ==================================================================================
        ``batch``                 ``scenario``, ``aircraft``, ``n`` (flights), ``asked`` (flights asked for), ``seed``,
                                  ``seeds`` [first, last] of those here, ``shard``, ``sampling``, ``draws`` (keys),
                                  ``confidence`` of every interval, ``engine``, ``workers``, ``wall_time_s``,
                                  ``flights_per_second``, ``flight_wall_time_s`` {``median``, ``p95``}
        ``rates``                 ``success`` (landed in the box) and ``landed``: rates; ``outcomes``: [``outcome``,
                                  rate]; ``limits``: [``key``, ``title``, ``unit``, ``limit``, ``side``, ``of``, rate
                                  of those that missed it]; ``can_show``; ``text``: [sentence]
        ``verdict``               ``limits`` (of the box) and ``tracking``: [``key``, ``title``, ``unit``, ``limit``,
                                  ``side``, ``of``, ``source``, rate of those beyond it, ``below``: what n of them
                                  show, one-sided; ``quantile`` (99 % towards the limit) {``p``, ``value``, ``low``,
                                  ``high``}, ``margin`` to it, ``worst``, ``margin_of_worst``, ``used``: shares of the
                                  limit, ``criterion`` that it stands for {``rate``, ``text``, ``source``}];
                                  ``outcomes``: [``key``, ``title``, rate], which together are all flights; ``harm``:
                                  rate of those that came down badly without a flag, and ``below``; ``go_arounds``:
                                  [``reason``, rate]; ``protection`` {``risk``, ``levels``: [``name``, ``flights``:
                                  rate of those with any error beyond it, ``frames``, ``exceeded_frames``, ``share``
                                  and its interval, ``state`` (kept, more, open), ``last_m``], ``misleading``: rate of
                                  flights with any such frame while no alarm stood, and ``frames``}; ``faults``
                                  {``monitored``, ``within_s``, ``detected`` within it, ``detected_ever`` and
                                  ``false_alarms``: rates; ``median_s``, ``longest_s``}; ``text``
        ``touchdown``             ``points`` (columns), ``ellipses``: [``level`` (%), ``center`` or None,
                                  ``semi_major_m``, ``semi_minor_m``, ``angle_deg`` from x towards y, ``polygon``
                                  {``x_m``, ``y_m``}, ``inside``: rate], ``box``, ``runway``, ``aim_point_m``, ``text``
        ``distributions``         [``key``, ``title``, ``unit``, ``n``, ``mean``, ``std``, ``min``, ``max``,
                                  ``quantiles``: [``p``, ``value``, ``low``, ``high``], ``magnitude_quantiles`` (where
                                  the sign does not count), ``histogram`` {``edges``, ``counts``}, ``limits``,
                                  ``exceedance``: [``side``, ``magnitude``, ``label``, ``limit``, ``x``, ``share``,
                                  ``low``, ``high``]]
        ``tracking``              [``key``, ``title``, ``unit``, ``rms`` and ``p95`` over flights: ``quantiles``,
                                  ``histogram``; ``criteria``: [``limit``, ``text``, ``source``, ``kept``: rate]]
        ``envelopes``             ``distance_m``, ``in_the_air``, ``series``: [``source``, ``quantity``, ``unit``,
                                  ``p50``, ``p68``, ``p95``, ``p99_7``, ``p95_low``, ``p95_high``, ``count``,
                                  ``share``, ``sigma_rms`` if fused]; ``bounds`` (the paper's): [``quantity``,
                                  ``stage``, ``value``, ``from_m``, ``to_m``, ``p95``, ``source``];
                                  ``limits`` (published): [``name``, ``quantity``, ``distance_m``, ``value``,
                                  ``p95``, ``source``]; their ``p95`` says of each source whether its 95th percentile
                                  keeps to it: ``state`` (kept, broken, too few flights, none), ``first_m`` and
                                  ``last_m`` of the distances judged, ``within_from_m``; ``text``
        ``consistency``           ``nees``: [``key``, ``phase``, ``dof``, ``flights``, ``frames``, ``mean``, ``low``,
                                  ``high``, ``median`` {``value``, ``low``, ``high``}, ``bound_low``,
                                  ``bound_high``, ``errors_over_sigma``, ``verdict``];
                                  ``coverage``: [``quantity``, ``expected``, ``mean``, ``low``, ``high``, ``agrees``];
                                  ``text``
        ``sensitivity``           ``inputs``, ``results``, ``pairs``: [``input``, ``result``, ``n``, ``rho``, ``p``,
                                  ``p_adjusted``, ``significant``, ``spread``: the same of the distance from the
                                  median]; ``method``, ``text``
        ``worst``                 ``rule``, ``flights``: [``rank``, ``index``, ``seed``, ``outcome``, ``in_box``,
                                  ``reason``, ``score``, ``limit``, ``touchdown``, ``draws``: the most unusual,
                                  ``command``, in which ``DIR`` stands for the batch's folder]
        ``versions``              of what flew it
        ========================  ==================================================================================
    """
    sampling = str(identity.get("sampling") or _sampling(scenario))
    return dict(
        as_json(
            {
                "format": FORMAT,
                "batch": _batch(scenario, flights, identity, sampling),
                "rates": rates(scenario, flights, sampling),
                "verdict": verdict(scenario, flights),
                "touchdown": touchdown(scenario, flights),
                "distributions": distributions(scenario, flights),
                "tracking": tracking(flights),
                "envelopes": envelopes(flights),
                "consistency": consistency(flights),
                "sensitivity": sensitivity(flights),
                "worst": worst(scenario, flights),
                "versions": dict(identity.get("versions", {})),
            }
        )
    )


def _batch(scenario: Scenario, flights: Flights, identity: Mapping[str, Any], sampling: str) -> dict[str, Any]:
    wall = flights.numbers("wall_time_s")
    wall = wall[np.isfinite(wall)]
    took = identity.get("wall_time_s")
    return {
        "scenario": identity.get("scenario", scenario.name),
        "aircraft": scenario.aircraft_config.title,
        "n": flights.n,
        "asked": identity.get("n", flights.n),
        "seed": identity.get("seed"),
        "seeds": span_of(flights.columns["seed"]),
        "shard": identity.get("shard"),
        "sampling": sampling,
        "draws": list(flights.draws),
        "confidence": CONFIDENCE,
        "engine": identity.get("engine"),
        "workers": identity.get("workers"),
        "wall_time_s": took,
        "flights_per_second": flights.n / took if took else None,
        "flight_wall_time_s": {"median": np.median(wall), "p95": np.quantile(wall, 0.95)} if wall.size else None,
    }


def _sampling(scenario: Scenario) -> str:
    dispersions = getattr(scenario, "dispersions", None)
    return "random" if dispersions is None else str(dispersions.sampling)
