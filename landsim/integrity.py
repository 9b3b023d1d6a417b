"""What navigation says of its own integrity: lines that turn out to be others, and how far off it may be.

The protection level is that of a filter whose model holds: an error beyond it has the probability of the integrity
risk, by its own covariance and the normal distribution.  Faults that the model does not have are the monitor's part.
"""

import math
from statistics import NormalDist

from estimator.single_lines import LINES
from landsim.state import Alarm


def protection_factor(risk: float) -> float:
    """Standard deviations beyond which an error lies, on one side or the other, with a probability."""
    return NormalDist().inv_cdf(1.0 - 0.5 * risk)


class LineMonitor:
    """Finds lines that keep disagreeing with all else.

    A line is taken for another once it has been left out for ``confirm`` seconds more than it has been believed, and
    for itself again once it has been believed for as long.

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
        self._disagreed = 0.0

    def take(self, time: float, found: int, believed: int) -> None:
        """Take in what became of a frame.

        Parameters
        ----------
        time : float
            Of its capture, s.
        found, believed : int
            Lines as bits.
        """
        dt, self._time = max(time - self._time, 0.0), time
        if believed:
            self._aided = time
        for line in range(LINES):
            bit = 1 << line
            if found & bit:
                change = -dt if believed & bit else dt
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
        if self._disagreed >= self._confirm or sum(self._wrong) > 1:
            alarm |= Alarm.INCONSISTENT
        return alarm
