"""aircraft/pioneer: its numbers against the published ones, its signs, trim, modes, loops and wheels.

Published numbers are those of the sources named in aircraft/pioneer/README.md.
"""

import math
import re
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import pytest

from estimator.so3 import to_euler
from landsim.modes import modes, on_the_glide
from landsim.plant import Plant, load
from landsim.resources import find_aircraft
from landsim.runway import Runway
from landsim.state import Command
from landsim.truth import InitialState, Truth
from landsim.units import DEG, FT, HP, INCH, LBF, STANDARD_GRAVITY

FOLDER = find_aircraft("pioneer")[1]
RATE = 120.0
SQ_FT, SPAN_FT, CHORD_FT = 30.42, 16.9, 1.8


def bare() -> Any:
    """JSBSim with the aircraft, actuators without lag (as in trim)."""
    fdm = load(FOLDER, "pioneer")
    fdm.set_dt(1.0 / RATE)
    fdm.set_trim_status(True)
    return fdm


class Coefficients(NamedTuple):
    lift: float
    drag: float
    side: float
    roll: float
    pitch: float
    yaw: float


def coefficients(
    alpha_deg: float,
    beta_deg: float = 0.0,
    elevator_deg: float = 0.0,
    aileron_deg: float = 0.0,
    rudder_deg: float = 0.0,
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Coefficients:
    """What the model makes of an attitude and deflections: high up, less the published terms of the pitching rates."""
    fdm = bare()
    for name, value in {
        "ic/h-sl-ft": 3000.0,
        "ic/vt-fps": 130.0,
        "ic/alpha-deg": alpha_deg,
        "ic/beta-deg": beta_deg,
        "fcs/elevator-cmd-norm": elevator_deg / 20.0,
        "fcs/aileron-cmd-norm": aileron_deg / 20.0,
        "fcs/rudder-cmd-norm": rudder_deg / 20.0,
        "ic/p-rad_sec": rate[0],
        "ic/q-rad_sec": rate[1],
        "ic/r-rad_sec": rate[2],
    }.items():
        fdm[name] = value
    fdm.run_ic()
    fdm.run_ic()  # the surfaces follow the commands of the first
    force = fdm["aero/qbar-psf"] * SQ_FT
    # Bray p. 33, normalised with c/2V
    q = fdm["velocities/q-aero-rad_sec"] * CHORD_FT / 2.0 / 130.0
    alphadot = fdm["aero/alphadot-rad_sec"] * CHORD_FT / 2.0 / 130.0
    return Coefficients(
        fdm["aero/lift-lbs"] / force - 8.05 * q - 2.42 * alphadot,
        fdm["aero/drag-lbs"] / force,
        fdm["aero/side-lbs"] / force,
        fdm["aero/roll-lbsft"] / force / SPAN_FT,
        fdm["aero/pitch-lbsft"] / force / CHORD_FT + 36.6 * q + 11.0 * alphadot,
        fdm["aero/yaw-lbsft"] / force / SPAN_FT,
    )


# --- the tables -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("alpha", "lift", "drag", "pitch"),
    # Bray p. 50, table 4.7
    [
        (-8.0, -0.384, 0.0734, 0.411),
        (0.0, 0.385, 0.0601, 0.194),
        (6.0, 0.940, 0.0900, 0.012),
        (11.0, 1.295, 0.1397, -0.223),
        (17.0, 1.488, 0.2423, -0.573),
    ],
)
def test_incidence(alpha: float, lift: float, drag: float, pitch: float) -> None:
    found = coefficients(alpha)
    assert found.lift == pytest.approx(lift, abs=2e-4)
    assert found.drag == pytest.approx(drag, abs=2e-5)
    assert found.pitch == pytest.approx(pitch, abs=2e-4)


@pytest.mark.parametrize(
    ("alpha", "elevator", "lift", "drag", "pitch"),
    # Bray tables 4.4 (p. 41), 4.6 (p. 45) and Fig. 4.2 (p. 34): the last is a total, less its column of zero elevator
    [
        (4.0, -10.0, 0.766 - 0.080, 0.0767 + 0.0001, 0.080 + 0.4039 - 0.0681),
        (0.0, 20.0, 0.385 + 0.107, 0.0601 + 0.0074, 0.194 - 0.3001 - 0.1922),
        (6.0, 5.0, 0.940 + 0.032, 0.0900 + 0.0016, 0.012 - 0.1556 + 0.0041),
        (10.0, -15.0, 1.235 - 0.110, 0.1276 - 0.0042, -0.168 + 0.3178 + 0.1771),
        # at -20 degrees and high incidence the drag increment is held at that of -15 degrees
        (14.0, -20.0, 1.430 - 0.114, 0.1837 - 0.0094, -0.404 + 0.1367 + 0.4058),
    ],
)
def test_elevator(alpha: float, elevator: float, lift: float, drag: float, pitch: float) -> None:
    found = coefficients(alpha, elevator_deg=elevator)
    assert found.lift == pytest.approx(lift, abs=2e-4)
    assert found.drag == pytest.approx(drag, abs=2e-5)
    assert found.pitch == pytest.approx(pitch, abs=2e-4)


@pytest.mark.parametrize(
    ("alpha", "aileron", "roll"),
    # Bray p. 58, table 4.8: his negative aileron rolls right, ours is positive there
    [(6.50, 10.0, 0.0295), (6.50, -10.0, -0.0295), (0.20, 20.0, 0.0482), (12.71, -5.0, -0.0118), (2.29, 0.0, 0.0)],
)
def test_aileron_rolls(alpha: float, aileron: float, roll: float) -> None:
    assert coefficients(alpha, aileron_deg=aileron).roll == pytest.approx(roll, abs=2e-5)


@pytest.mark.parametrize(
    ("alpha", "aileron", "yaw"),
    # Bray p. 61, table 4.9: adverse, rolling right yaws left
    [(6.0, 10.0, -0.0038), (6.0, -10.0, 0.0038), (2.0, 20.0, -0.0044), (-7.0, 15.0, 0.0008)],
)
def test_aileron_yaws(alpha: float, aileron: float, yaw: float) -> None:
    assert coefficients(alpha, aileron_deg=aileron).yaw == pytest.approx(yaw, abs=2e-6)


@pytest.mark.parametrize(
    ("beta", "rudder", "yaw"),
    # Bray p. 63, Fig. 4.20, the total; his rudder is positive left.  The last four are mended misprints.
    [
        (0.0, 10.0, 0.0188),
        (0.0, -10.0, -0.0148),
        (5.0, 0.0, 0.0101),
        (-10.0, 20.0, 0.0101),
        (20.0, -20.0, 0.0054),
        (-15.0, -20.0, -0.0586),
        (-12.5, -20.0, -0.0518),
        (5.0, 5.0, 0.0201),
        (5.0, -5.0, 0.0001),
    ],
)
def test_rudder_and_sideslip_yaw(beta: float, rudder: float, yaw: float) -> None:
    assert coefficients(0.0, beta, rudder_deg=rudder).yaw == pytest.approx(yaw, abs=2e-5)


def test_side_force_is_the_linear_one() -> None:
    # Bray p. 33: CY_beta -0.819; CY_dr 0.191 with his rudder positive left
    assert coefficients(2.0, beta_deg=5.0).side == pytest.approx(-0.819 * 5.0 * DEG, rel=1e-6)
    assert coefficients(2.0, rudder_deg=10.0).side == pytest.approx(-0.191 * 10.0 * DEG, rel=1e-6)


def test_roll_due_to_sideslip_and_rudder() -> None:
    # Bray p. 33: Cl_beta -0.023, Cl_dr -0.00229 with his rudder positive left
    assert coefficients(2.0, beta_deg=5.0).roll == pytest.approx(-0.023 * 5.0 * DEG, rel=1e-6)
    assert coefficients(2.0, rudder_deg=10.0).roll == pytest.approx(0.00229 * 10.0 * DEG, rel=1e-6)


def test_rates() -> None:
    # Bray p. 33: Cl_p -0.45, Cl_r 0.265, Cn_p -0.11, Cn_r -0.2, with b/2V; the pitching terms are those taken off above
    p, q, r = 0.4, 0.3, 0.2
    found = coefficients(4.0, rate=(p, q, r))
    scale = SPAN_FT / 2.0 / 130.0
    assert found.lift == pytest.approx(0.766, abs=2e-4)
    assert found.pitch == pytest.approx(0.080, abs=2e-4)
    assert found.roll == pytest.approx(scale * (-0.45 * p + 0.265 * r), abs=1e-4)
    assert found.yaw == pytest.approx(scale * (-0.11 * p - 0.2 * r), abs=1e-4)


def test_beyond_the_tables_it_stalls_and_goes_on_restoring() -> None:
    end, stalled, deep = coefficients(17.0), coefficients(25.0), coefficients(45.0)
    assert stalled.lift < end.lift
    assert end.drag < stalled.drag < deep.drag
    assert end.pitch > stalled.pitch > deep.pitch
    below = coefficients(-20.0)
    assert below.drag > coefficients(-8.0).drag
    assert below.pitch > coefficients(-8.0).pitch


# --- signs, as landsim/truth.py has them ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "acceleration", "sign"),
    [
        ("fcs/elevator-cmd-norm", "accelerations/qdot-rad_sec2", -1.0),
        ("fcs/aileron-cmd-norm", "accelerations/pdot-rad_sec2", 1.0),
        ("fcs/rudder-cmd-norm", "accelerations/rdot-rad_sec2", 1.0),
    ],
)
def test_control_signs(command: str, acceleration: str, sign: float) -> None:
    def at(value: float) -> float:
        fdm = bare()
        fdm["ic/h-sl-ft"], fdm["ic/vt-fps"], fdm["ic/alpha-deg"], fdm[command] = 3000.0, 130.0, 2.7, value
        fdm.run_ic()
        fdm.run_ic()
        return float(fdm[acceleration])

    assert sign * (at(0.5) - at(-0.5)) > 1.0


# --- engine and propeller ---------------------------------------------------------------------------------------------


def run_engine(fdm: Any, steps: int) -> None:
    """Run with the airframe held."""
    names = [
        f"simulation/integrator/{rate}/{of}" for rate in ("rate", "position") for of in ("rotational", "translational")
    ]
    kept = [fdm[name] for name in names]
    for name in names:
        fdm[name] = 0
    fdm["propulsion/set-running"] = -1
    for _ in range(steps):
        fdm.run()
    for name, value in zip(names, kept, strict=True):
        fdm[name] = value


def thrust(speed: float, throttle: float) -> tuple[float, float]:
    """Steady thrust (N) and power (W) with the airframe held."""
    fdm = bare()
    fdm["ic/h-sl-ft"], fdm["ic/vt-fps"] = 0.0, speed / FT
    fdm.run_ic()
    fdm["fcs/throttle-cmd-norm"] = throttle
    run_engine(fdm, 3000)
    return fdm["propulsion/engine/thrust-lbs"] * LBF, fdm["propulsion/engine/power-hp"] * HP


def test_full_thrust_is_within_the_engine_s_power() -> None:
    force, power = thrust(40.0, 1.0)
    assert power / HP == pytest.approx(26.0, abs=0.01)
    assert 0.6 * power < force * 40.0 < 0.8 * power
    assert force < 27.0 * HP / 40.0


def test_static_thrust_is_about_100_lb() -> None:
    assert thrust(0.0, 1.0)[0] / LBF == pytest.approx(100.0, abs=5.0)


def test_idle_neither_pulls_nor_brakes_much() -> None:
    assert abs(thrust(40.0, 0.0)[0]) < 10.0


# --- trim and modes ---------------------------------------------------------------------------------------------------


def trimmed(speed: float, flight_path_deg: float, height: float = 60.0) -> tuple[Plant, Truth]:
    plant = Plant(FOLDER, "pioneer", Runway(2000.0, 30.0), RATE)
    return plant, plant.start(InitialState((-1000.0, 0.0, -height), speed, 0.0, flight_path_deg * DEG))


@pytest.mark.parametrize(
    ("speed", "flight_path", "alpha", "elevator", "thrust_n", "pitch"),
    # computed from the published tables by themselves: sea level, 420 lb, thrust along body x through the cg
    [
        (40.0, 0.0, 2.71, 3.9, 196.0, 2.7),
        (40.0, -3.0, 2.72, 3.9, 98.0, -0.3),
        (36.0, -3.0, 4.6, None, 84.0, 1.6),
    ],
)
def test_trim(
    speed: float, flight_path: float, alpha: float, elevator: float | None, thrust_n: float, pitch: float
) -> None:
    trim = trimmed(speed, flight_path)[0].trim
    assert trim.alpha / DEG == pytest.approx(alpha, abs=0.15)
    assert trim.thrust == pytest.approx(thrust_n, abs=6.0)
    assert trim.pitch / DEG == pytest.approx(pitch, abs=0.15)
    if elevator is not None:
        assert trim.elevator / DEG == pytest.approx(elevator, abs=0.5)


def test_modes_are_those_of_the_readme() -> None:
    found = {mode.name: mode for mode in modes(on_the_glide(FOLDER, "pioneer"))}
    rows = {
        cells[0]: cells[1]
        for line in (FOLDER / "README.md").read_text(encoding="utf-8").splitlines()
        if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 5 and cells[0] in found
    }
    assert rows.keys() == found.keys()
    for name, eigenvalue in rows.items():
        parts = re.fullmatch(r"(-?[\d.]+)(?: ± ([\d.]+) i)?", eigenvalue)
        assert parts is not None, eigenvalue
        documented = complex(float(parts[1]), float(parts[2] or 0.0))
        assert found[name].eigenvalue == pytest.approx(documented, abs=0.02 * abs(documented) + 0.002)
    for name in ("short period", "phugoid", "Dutch roll"):
        assert 0.0 < found[name].damping < 1.0
    assert found["roll"].eigenvalue.real < -3.0
    assert 0.0 < found["spiral"].eigenvalue.real < 0.3


def test_damping_derivatives_are_those_of_the_published_coefficients() -> None:
    # by hand: dp/dt per p and dr/dt per p of Cl_p -0.45, Cn_p -0.11 with b/2V, 0.5 ρ V² S b = 14225 N m, b/2V 0.0644 s;
    # inertias in slug ft², Ixz the integral of x z dm, +4.902
    plant = on_the_glide(FOLDER, "pioneer")
    names, matrix = plant.linearised()
    p, r = names.index("P"), names.index("R")
    density = 0.5 * 1.2179 * 40.0**2  # ISA at 60 m
    area, span, slug_ft2 = SQ_FT * FT**2, SPAN_FT * FT, 1.3558179
    arm = density * area * span * span / 80.0 / slug_ft2
    ixx, izz, ixz = 34.832, 82.22, 4.902
    determinant = ixx * izz - ixz**2
    assert matrix[p, p] == pytest.approx(arm * (izz * -0.45 + ixz * -0.11) / determinant, rel=0.02)
    assert matrix[r, p] == pytest.approx(arm * (ixz * -0.45 + ixx * -0.11) / determinant, rel=0.03)


# --- inner loops ------------------------------------------------------------------------------------------------------

Pilot = Callable[[Truth, Command], Command]


def fly(plant: Plant, truth: Truth, seconds: float, pilot: Pilot) -> list[Truth]:
    """Fly on perfect measurements; the pilot turns the truth and what holds trim into the command of every step."""
    read = plant._fdm.get_property_value
    hold = Command(True, plant.trim.pitch, 0.0, truth.airspeed, False, False, 0.0, 0.0, 0.0)
    flown = [truth]
    for _ in range(round(seconds * RATE)):
        roll, pitch, _ = to_euler(truth.R_runway_from_body)
        rate = read("velocities/p-rad_sec"), read("velocities/q-rad_sec"), read("velocities/r-rad_sec")
        plant.feed(rate, read("accelerations/Ny") * STANDARD_GRAVITY, roll, pitch, truth.airspeed)
        plant.command(pilot(truth, hold))
        truth = plant.step()
        flown.append(truth)
    return flown


class Response(NamedTuple):
    rise: float
    """s, from 10 to 90 %."""
    overshoot: float
    """Share of the step."""
    end: float


def response(values: list[float], start: float, step: float) -> Response:
    shares = [(value - start) / step for value in values]
    rise = next(i for i, x in enumerate(shares) if x > 0.9) - next(i for i, x in enumerate(shares) if x > 0.1)
    return Response(rise / RATE, max(shares) - 1.0, shares[-1])


SPEEDS = [33.0, 36.0, 40.0, 42.0]


@pytest.mark.parametrize("speed", SPEEDS)
def test_pitch_step(speed: float) -> None:
    plant, truth = trimmed(speed, -3.0, 600.0)
    flown = fly(plant, truth, 12.0, lambda _, hold: hold._replace(pitch=hold.pitch + 2.0 * DEG))
    found = response([to_euler(t.R_runway_from_body)[1] for t in flown], plant.trim.pitch, 2.0 * DEG)
    assert found.rise < 1.3
    assert found.overshoot < 0.1
    assert found.end == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("speed", SPEEDS)
def test_roll_step_turns_without_slipping(speed: float) -> None:
    plant, truth = trimmed(speed, -3.0, 600.0)
    flown = fly(plant, truth, 12.0, lambda _, hold: hold._replace(roll=10.0 * DEG))
    found = response([to_euler(t.R_runway_from_body)[0] for t in flown], 0.0, 10.0 * DEG)
    assert found.rise < 0.7
    assert found.overshoot < 0.12
    assert found.end == pytest.approx(1.0, abs=0.06)
    slip = [math.asin(sum(a * b for a, b in zip(t.R_runway_from_body[1::3], t.velocity, strict=True)) / t.airspeed)
            for t in flown]  # fmt: skip
    assert max(abs(x) for x in slip) < 2.0 * DEG
    assert abs(slip[-1]) < 0.3 * DEG
    # the coordinated turn: heading rate g tan(roll) / V
    turned = to_euler(flown[-1].R_runway_from_body)[2] - to_euler(flown[-121].R_runway_from_body)[2]
    assert turned == pytest.approx(9.78 * math.tan(10.0 * DEG) / flown[-1].airspeed, rel=0.08)


@pytest.mark.parametrize("speed", SPEEDS)
def test_speed_step(speed: float) -> None:
    plant, truth = trimmed(speed, -3.0, 2000.0)
    flown = fly(plant, truth, 60.0, lambda _, hold: hold._replace(airspeed=hold.airspeed + 2.0))
    found = response([t.airspeed for t in flown], speed, 2.0)
    assert found.rise < 15.0
    assert found.overshoot < 0.15
    assert found.end == pytest.approx(1.0, abs=0.05)


def test_engaging_makes_no_bump() -> None:
    plant, truth = trimmed(40.0, -3.0, 600.0)
    flown = fly(plant, truth, 4.0, lambda t, hold: hold._replace(engaged=t.time > 2.0))
    for surface in ("elevator", "aileron", "rudder"):
        values = [getattr(t, surface) for t in flown]
        assert max(values) - min(values) < 0.3 * DEG
    assert max(t.throttle for t in flown) - min(t.throttle for t in flown) < 0.02


def test_not_engaged_only_the_rates_are_damped() -> None:
    # the commands are far off: nothing may follow them
    plant, truth = trimmed(40.0, -3.0, 600.0)
    flown = fly(plant, truth, 3.0, lambda _, hold: hold._replace(engaged=False, pitch=0.3, roll=0.5, airspeed=60.0))
    assert max(abs(t.elevator - truth.elevator) for t in flown) < 0.2 * DEG
    assert max(abs(t.throttle - truth.throttle) for t in flown) < 1e-9


def test_surfaces_keep_their_limits_of_angle_and_rate() -> None:
    plant, truth = trimmed(40.0, 0.0, 600.0)
    flown = fly(plant, truth, 3.0, lambda t, hold: hold._replace(pitch=0.6 if t.time % 1.0 < 0.5 else -0.6, roll=1.0))
    for surface in ("elevator", "aileron", "rudder"):
        values = [getattr(t, surface) for t in flown]
        rates = [abs(b - a) * RATE for a, b in pairwise(values)]
        assert max(abs(x) for x in values) <= 20.0 * DEG + 1e-9
        assert max(rates) <= 60.0 * DEG + 1e-6
    assert max(abs(t.elevator) for t in flown) > 19.9 * DEG  # the test reaches them
    assert max(abs(b.aileron - a.aileron) for a, b in pairwise(flown)) * RATE > 59.0 * DEG


def test_integrators_do_not_wind_up() -> None:
    # ten seconds of a speed that the engine cannot reach, then back: the throttle comes off at once
    plant, truth = trimmed(40.0, 0.0, 600.0)
    flown = fly(plant, truth, 21.0, lambda t, hold: hold._replace(airspeed=70.0 if t.time < 20.0 else 40.0))
    assert flown[-121].throttle > 0.95
    assert flown[-1].throttle < 0.3


def test_idle_closes_the_throttle() -> None:
    plant, truth = trimmed(40.0, -3.0, 600.0)
    flown = fly(plant, truth, 3.0, lambda _, hold: hold._replace(idle=True))
    assert flown[-1].throttle == pytest.approx(0.02, abs=1e-3)


READABLE = {
    "ap/align",
    "ap/rudder-align-rad",
    "imu/p-rad_sec", "imu/q-rad_sec", "imu/r-rad_sec", "imu/ay-mps2",
    "nav/roll-rad", "nav/pitch-rad", "nav/airspeed-mps",
    "ap/engaged", "ap/pitch-cmd-rad", "ap/roll-cmd-rad", "ap/airspeed-cmd-mps", "ap/idle", "ap/ground",
    "ap/steering-cmd-norm", "ap/brake-cmd-norm",
    # what trim leaves
    "fcs/elevator-cmd-norm", "fcs/pitch-trim-cmd-norm", "fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm",
    "fcs/throttle-cmd-norm",
}  # fmt: skip


def test_the_loops_read_no_true_state() -> None:
    flight_control = ET.parse(FOLDER / "pioneer.xml").getroot().findall("flight_control")
    systems = [ET.parse(path).getroot() for path in sorted((FOLDER / "Systems").glob("*.xml"))]
    assert len(systems) == 2
    read: set[str] = set()
    written: set[str] = set()
    for element in (e for root in (*flight_control, *systems) for e in root.iter()):
        words = [*(element.text or "").split(), *(element.tail or "").split()]
        words += [word for key, value in element.attrib.items() if key != "name" for word in value.split()]
        found = {word.lstrip("-") for word in words if re.search("[a-z]/|/[a-z]", word)}
        if element.tag == "output":
            written |= found
        elif not (element.tag == "property" and "value" in element.attrib):  # a declaration is not a reading
            read |= found
        if "/" in element.get("name", ""):
            written.add(element.attrib["name"])
    assert {"imu/q-rad_sec", "nav/pitch-rad", "ap/elevator-cmd-rad"} <= read  # the search finds what is there
    assert read - written <= READABLE


# --- on the wheels ----------------------------------------------------------------------------------------------------


def on_wheels(speed: float) -> Any:
    """JSBSim with the aircraft rolling on its wheels (m/s), engine idling."""
    fdm = load(FOLDER, "pioneer")
    fdm.set_dt(1.0 / RATE)
    fdm["ic/terrain-elevation-ft"], fdm["ic/h-agl-ft"] = 0.0, 31.2 * INCH / FT
    fdm["ic/psi-true-deg"], fdm["ic/theta-deg"], fdm["ic/vg-fps"] = 90.0, 0.4, speed / FT
    fdm.run_ic()
    run_engine(fdm, 120)  # the first step from standstill would have an absurd torque
    fdm["ap/ground"] = 1
    return fdm


def test_it_stands_still_on_its_wheels() -> None:
    fdm = on_wheels(0.0)
    fdm["ap/brake-cmd-norm"] = 0.3
    for _ in range(600):
        fdm.run()
    start = {name: fdm[name] for name in ("position/h-agl-ft", "attitude/theta-rad", "position/long-gc-rad")}
    for _ in range(600):
        fdm.run()
    assert [fdm[f"gear/unit[{i}]/WOW"] for i in range(3)] == [1, 1, 1]
    assert [fdm[f"contact/unit[{i}]/WOW"] for i in range(3, 8)] == [0] * 5
    assert fdm["velocities/vg-fps"] < 1e-3
    assert fdm["position/h-agl-ft"] == pytest.approx(start["position/h-agl-ft"], abs=1e-4)
    assert fdm["attitude/theta-rad"] == pytest.approx(start["attitude/theta-rad"], abs=1e-4)
    # by hand: 420 lb, 11/59 of it on the nose wheel; springs 1200 and 900 lb/ft; wheels 33 in below the cg
    nose, main = 420.0 * 11.0 / 59.0 / 1200.0, 420.0 * 48.0 / 59.0 / 1800.0
    assert fdm["position/h-agl-ft"] == pytest.approx(33.0 / 12.0 - (main * 48.0 + nose * 11.0) / 59.0, abs=0.005)
    assert fdm["attitude/theta-rad"] == pytest.approx((main - nose) * 12.0 / 59.0, abs=0.001)


@pytest.mark.parametrize("brake", [0.5, 1.0])
def test_brakes_stop_it_without_diving(brake: float) -> None:
    fdm = on_wheels(20.0)
    for _ in range(60):
        fdm.run()
    level, lowest, steps = fdm["attitude/theta-deg"], 90.0, 0
    fdm["ap/brake-cmd-norm"] = brake
    while fdm["velocities/vg-fps"] > 0.05 and steps < 20 * RATE:
        fdm.run()
        steps += 1
        lowest = min(lowest, fdm["attitude/theta-deg"])
        assert fdm["contact/unit[3]/WOW"] == 0
    assert fdm["velocities/vg-fps"] <= 0.05
    assert lowest > level - 2.0


def test_steering_turns_right_with_a_positive_command() -> None:
    fdm = on_wheels(5.0)
    fdm["ap/steering-cmd-norm"] = 0.3
    for _ in range(120):
        fdm.run()
    assert fdm["attitude/psi-deg"] > 91.0


def test_rate_damping_is_calm_on_the_wheels() -> None:
    fdm = on_wheels(30.0)
    swing = 0.0
    for step in range(600):
        for axis in "pqr":
            fdm[f"imu/{axis}-rad_sec"] = fdm[f"velocities/{axis}-rad_sec"]
        fdm["imu/ay-mps2"] = fdm["accelerations/Ny"] * STANDARD_GRAVITY
        fdm["nav/roll-rad"] = fdm["attitude/phi-rad"]
        fdm["nav/pitch-rad"] = fdm["attitude/theta-rad"]
        fdm["ap/engaged"] = 1
        fdm.run()
        if step > 240:
            swing = max(swing, abs(fdm["velocities/q-rad_sec"]), abs(fdm["velocities/p-rad_sec"]))
    assert swing < 0.5 * DEG


def test_touchdown_at_1_mps_does_not_bounce() -> None:
    plant, truth = trimmed(40.0, -1.0 / 40.0 / DEG, 4.0)
    flown = fly(plant, truth, 8.0, lambda t, hold: hold._replace(pitch=1.0 * DEG, idle=t.wow_left or t.wow_right))
    touched = next(i for i, t in enumerate(flown) if t.wow_left or t.wow_right)
    assert 0.8 < flown[touched - 1].velocity[2] < 1.2
    assert max(-t.velocity[2] for t in flown[touched:]) < 0.35  # m/s up
    in_the_air = sum(not (t.wow_left or t.wow_right) for t in flown[touched:]) / RATE
    assert in_the_air < 0.1, "seconds off the ground after the first contact"
    assert not any(t.structure_contact for t in flown)


def test_aircraft_file_has_the_model_s_wheels() -> None:
    root = ET.parse(FOLDER / "pioneer.xml").getroot()
    gear = tomllib.loads((FOLDER / "aircraft.toml").read_text(encoding="utf-8"))["gear"]
    cg = location(root, "mass_balance/location")
    for name, key in (("NOSE", "nose"), ("LEFT_MAIN", "left"), ("RIGHT_MAIN", "right")):
        wheel = location(root, f"ground_reactions/contact[@name='{name}']/location")
        body = [(cg[0] - wheel[0]) * INCH, (wheel[1] - cg[1]) * INCH, (cg[2] - wheel[2]) * INCH]
        assert gear[f"{key}_wheel_body_m"] == pytest.approx(body)


def location(root: ET.Element, path: str) -> tuple[float, float, float]:
    """A place in the structural frame, inches."""
    found = root.find(path)
    assert found is not None
    x, y, z = (float(found.findtext(axis, "nan")) for axis in "xyz")
    return x, y, z


def test_reference_point_and_cg_coincide() -> None:
    root = ET.parse(FOLDER / "pioneer.xml").getroot()
    assert location(root, "metrics/location[@name='AERORP']") == location(root, "mass_balance/location")
