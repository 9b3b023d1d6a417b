"""The aircraft's natural modes, from JSBSim's own linearisation about trim; controls fixed.

``python -m landsim.modes pioneer`` prints those in the README of ``aircraft/pioneer``.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landsim.config import load_aircraft
from landsim.errors import InputError, one_line
from landsim.plant import Plant, TrimError
from landsim.runway import Runway
from landsim.truth import InitialState
from landsim.units import DEG

LONGITUDINAL = ("Vt", "Alpha", "Theta", "Q")
LATERAL = ("Beta", "Phi", "P", "R")


@dataclass(frozen=True)
class Mode:
    """One mode, by its eigenvalue (1/s; of a pair, the one with the positive imaginary part)."""

    name: str
    eigenvalue: complex

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, rad/s; of a real mode, the eigenvalue's size."""
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        """Damping ratio; 1 or -1 for a real mode."""
        return -self.eigenvalue.real / abs(self.eigenvalue)

    @property
    def time_constant(self) -> float:
        """Time to fall (or, negative, to grow) by the factor e, s."""
        return -1.0 / self.eigenvalue.real


def modes(plant: Plant) -> tuple[Mode, ...]:
    """Short period, phugoid, Dutch roll, roll and spiral of a plant in trim.

    The eigenvalues are those of the eight states of speed, incidence, attitude and rate.  Position and heading hardly
    act back and are left out, and so is the propeller's speed: JSBSim's linearisation lets it reach its steady
    state at every speed of flight.

    Raises
    ------
    ValueError
        If they are not two longitudinal pairs, a lateral pair and two real lateral ones: the modes would have other
        names.
    """
    names, matrix = plant.linearised()
    kept = [names.index(name) for name in (*LONGITUDINAL, *LATERAL)]
    values, vectors = np.linalg.eig(matrix[np.ix_(kept, kept)])
    share = np.abs(vectors[: len(LONGITUDINAL)]) / np.array([[130.0], [1.0], [1.0], [1.0]])  # speed per ft/s of flight
    along = np.linalg.norm(share, axis=0) > np.linalg.norm(vectors[len(LONGITUDINAL) :], axis=0)
    upper = values.imag > 0.0
    real = values.imag == 0.0
    if (np.sum(along & upper), np.sum(~along & upper), np.sum(~along & real)) != (2, 1, 2):
        raise ValueError(f"the eigenvalues are not those of the five usual modes: {np.round(values, 3).tolist()}")
    fast, slow = sorted(values[along & upper], key=abs, reverse=True)
    (dutch,) = values[~along & upper]
    roll, spiral = sorted(values[~along & real], key=abs, reverse=True)
    return (
        Mode("short period", complex(fast)),
        Mode("phugoid", complex(slow)),
        Mode("Dutch roll", complex(dutch)),
        Mode("roll", complex(roll)),
        Mode("spiral", complex(spiral)),
    )


def on_the_glide(folder: Path, model: str, speed: float = 40.0, flight_path: float = -3.0 * DEG) -> Plant:
    """A plant in trim 60 m above sea level, at a speed (m/s) and flight-path angle (rad)."""
    plant = Plant(folder, model, Runway(length=2000.0, width=30.0), rate_hz=120.0)
    plant.start(InitialState((-1000.0, 0.0, -60.0), speed, 0.0, flight_path))
    return plant


def table(found: tuple[Mode, ...]) -> str:
    """The modes as a table in Markdown."""
    rows = ["| mode | eigenvalue 1/s | frequency rad/s | damping | time constant s |", "|---|---|---|---|---|"]
    for mode in found:
        value = mode.eigenvalue
        if value.imag:
            eigenvalue = f"{value.real:.3f} ± {value.imag:.3f} i"
            rows.append(f"| {mode.name} | {eigenvalue} | {mode.frequency:.3f} | {mode.damping:.3f} | |")
        else:
            doubling = f" (doubles in {math.log(2.0) / value.real:.1f} s)" if value.real > 0.0 else ""
            rows.append(f"| {mode.name} | {value.real:.3f} | | | {mode.time_constant:.3f}{doubling} |")
    return "\n".join(rows)


def main(arguments: list[str]) -> int:
    """Print the modes of the aircraft named; returns the exit code, 2 if it has none to print, told in one line."""
    try:
        if len(arguments) > 1 or any(name.startswith("-") for name in arguments):
            raise InputError("usage: python -m landsim.modes AIRCRAFT, a shipped name or a folder")
        aircraft = load_aircraft(arguments[0] if arguments else "pioneer")
        text = table(modes(on_the_glide(aircraft.folder, aircraft.model)))
    except (ValueError, TrimError) as error:
        sys.stderr.write(f"landsim.modes: {one_line(str(error))}\n")
        return 2
    sys.stdout.write(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
