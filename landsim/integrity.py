"""What navigation says of its own integrity: lines that turn out to be others, and how far off it may be.

The protection level is that of a filter whose model holds: an error beyond it has the probability of the integrity
risk, by its own covariance and the normal distribution.  Faults that the model does not have are the monitor's part.
"""

import math
from statistics import NormalDist

import numpy as np

from estimator.single_lines import LINES
from estimator.so3 import Array
from landsim.state import Alarm


def protection_factor(risk: float) -> float:
    """Standard deviations beyond which an error lies, on one side or the other, with a probability."""
    return NormalDist().inv_cdf(1.0 - 0.5 * risk)


STRAINED = 5.0
"""Standard deviations from what is believed that no constant is off by: of 1.7 million normal ones a single one is."""


def is_strained(calibration: Array, sigma: Array) -> bool:
    """Whether an estimated constant is further from what was believed of it than it can be.

    Lines that lie wrong together, each frame by too little to be left out, are explained by the camera's calibration
    or the runway's width, until these are explained by nothing.

    Parameters
    ----------
    calibration, sigma : (n,) array
        The constants as estimated, and their standard deviations before any measurement; zero for one that is known.
    """
    return bool((np.abs(calibration) > STRAINED * sigma).any())


class LineMonitor:
    """Finds lines that keep disagreeing with all else.

    A line is taken for another once it has been left out for ``confirm`` seconds more than it has been believed, and
    for itself again once it has been believed for as long.  Of one that never was believed for ``confirm`` seconds it
    is not known whether it is the line that is wrong, or the state, by what was believed before.

    Parameters
    ----------
    confirm : float
        s.
    unaided : float
        Time without any believed line that is still accepted, s.
    """

    def __init__(self, confirm: float, unaided: float) -> None:
        self._confirm = confirm
        self._unaided = unaided
        self._time = math.inf  # of the last frame; before the first no time has passed
        self._aided = 0.0
        self._against = [0.0] * LINES
        self._wrong = [False] * LINES
        self._agreed = [0.0] * LINES
        self._disagreed = 0.0
        self._strained = False

    def take(self, time: float, found: int, believed: int, *, strained: bool = False) -> None:
        """Take in what became of a frame.

        Parameters
        ----------
        time : float
            Of its capture, s.
        found, believed : int
            Lines as bits.
        strained : bool
            Whether the calibration had to be `is_strained` for the lines to agree.
        """
        self._strained = strained
        dt, self._time = max(time - self._time, 0.0), time
        if believed:
            self._aided = time
        for line in range(LINES):
            bit = 1 << line
            if found & bit:
                change = -dt if believed & bit else dt
                self._agreed[line] = min(self._agreed[line] + max(-change, 0.0), self._confirm)
                self._against[line] = min(max(self._against[line] + change, 0.0), self._confirm)
            if self._against[line] >= self._confirm:
                self._wrong[line] = True
            elif self._against[line] == 0.0:
                self._wrong[line] = False
        if found:
            self._disagreed = min(max(self._disagreed + (-dt if believed else dt), 0.0), self._confirm)

    @property
    def wrong(self) -> int:
        """Lines that are taken for others, as bits."""
        return sum(1 << line for line in range(LINES) if self._wrong[line])

    def alarm(self, time: float) -> Alarm:
        """What there is to say at a time (s)."""
        alarm = Alarm.WRONG_LINE if any(self._wrong) else Alarm.NONE
        if time - self._aided > self._unaided:
            alarm |= Alarm.UNAIDED
        never_agreed = any(
            wrong and agreed < self._confirm for wrong, agreed in zip(self._wrong, self._agreed, strict=True)
        )
        if never_agreed or self._strained or self._disagreed >= self._confirm or sum(self._wrong) > 1:
            alarm |= Alarm.INCONSISTENT
        return alarm
