"""Published limits that a batch is shown beside, each with where it comes from.

None of them is this project's, none was written for this aircraft, and to meet one certifies nothing.
"""

from typing import NamedTuple

from landsim.units import FT

NO_CLAIM = "for comparison: from a secondary source, written for transport aircraft; no certification is claimed"


class Limit(NamedTuple):
    """Of the magnitude of an error, by distance to the threshold."""

    name: str
    quantity: str
    """Of `landsim.log.QUANTITIES`."""
    points: tuple[tuple[float, float], ...]
    """Distance to the threshold, limit; m, falling; straight lines between them."""
    source: str


_WAYFINDER = "Airbus Wayfinder, limits of a vision landing system's error by range"
_ICAO = "ICAO Annex 10, accuracy of satellite navigation for approach and landing, 95 %"
_FAR = 6000.0

NAVIGATION: tuple[Limit, ...] = (
    Limit(
        "Wayfinder",
        "cross_m",
        ((6000.0, 66.6), (4500.0, 55.5), (1450.0, 33.0), (860.0, 18.4), (280.0, 11.0)),
        _WAYFINDER,
    ),
    Limit(
        "Wayfinder",
        "height_m",
        ((6000.0, 33.4), (4500.0, 25.5), (1450.0, 9.3), (860.0, 6.1), (280.0, 2.3)),
        _WAYFINDER,
    ),
    Limit("Wayfinder", "along_m", ((6000.0, 370.0), (0.0, 10.0)), _WAYFINDER),
    *(
        Limit(f"ICAO {category}", quantity, ((_FAR, value), (0.0, value)), _ICAO)
        for category, horizontal, vertical in (
            ("CAT I", 16.0, 4.0),
            ("CAT II-IIIA", 6.9, 2.0),
            ("CAT IIIB", 6.1, 2.0),
        )
        for quantity, value in (("cross_m", horizontal), ("height_m", vertical))
    ),
)
"""Of CAT I's vertical 4 to 6 m the stricter."""


class Criterion(NamedTuple):
    """A limit that 95 % of a flight's deviations keep to."""

    column: str
    """Of a row: the flight's 95th percentile."""
    limit: float
    """m."""
    text: str
    estimate: bool
    """Whether the limit in metres is a conversion that is open to question."""
    source: str


_LOCALIZER = 25.0 / 150.0 * 105.0
"""25 µA in metres at the threshold, where 150 µA (0.155 DDM) stand for 105 m from the centreline."""

TRACKING: tuple[Criterion, ...] = (
    Criterion(
        "glide_slope_to_flare_p95_m",
        12.0 * FT,
        "12 ft; the criterion is 35 µA or 12 ft, whichever is larger, so that whoever keeps to 12 ft meets it anywhere."
        " What the start was off by counts too",
        estimate=False,
        source=f"CS-AWO and AC 120-28D, glide-slope tracking, 95 %; {NO_CLAIM}",
    ),
    Criterion(
        "localizer_p95_m",
        _LOCALIZER,
        "25 µA at the threshold, where it is fewest metres before the runway, by the nominal sensitivity of ICAO"
        " Annex 10 (0.00145 DDM/m, 150 µA at 105 m from the centreline): an estimate, and wider than"
        " many a runway. What the start was off by counts too",
        estimate=True,
        source=f"CS-AWO and AC 120-28D, localizer tracking, Cat III, 95 %; {NO_CLAIM}",
    ),
)


class Asked(NamedTuple):
    """How often a touchdown may be beyond a limit."""

    rate: float
    """Of all landings, on average."""
    text: str
    source: str


_LANDING = f"CS-AWO and AC 120-28D, touchdown; {NO_CLAIM}"

TOUCHDOWN: dict[str, Asked] = {
    "along_min_m": Asked(1e-6, "short of 60 m (200 ft) past the threshold", _LANDING),
    "along_max_m": Asked(1e-6, "beyond 900 m (3000 ft) past the threshold", _LANDING),
    "cross_max_m": Asked(1e-6, "outboard gear more than 21 m (70 ft) off the centreline of a runway of 45 m", _LANDING),
    "sink_max_mps": Asked(1e-6, "sink rate to the structural limit load", _LANDING),
    "bank_max_deg": Asked(1e-8, "bank to the touch of a wing tip, 1·10⁻⁷ by AC 120-28D", _LANDING),
}
"""By the limits of a scenario's box that stand in their place, scaled to its runway and gear."""
