"""Pictures: of a flight, here, and of studies and budgets, in ``envelope``, ``tilt`` and ``budget``.

Figures are built without pyplot, so that nothing is registered globally.  Colours are those of Okabe and Ito, and what
a colour tells a line style or a marker tells too, so that the pictures survive grey print.  The functions take the log
(``landsim.log.COLUMNS``), the metrics of ``landsim.metrics.flight_metrics`` and, where they need it, the scenario; they
work on any log, also on an empty one.
"""

from landsim.plots.camera import camera_views
from landsim.plots.controls import controls_and_attitude
from landsim.plots.course import profile_and_plan
from landsim.plots.integrity import integrity
from landsim.plots.navigation import consistency, navigation_errors

__all__ = ["camera_views", "consistency", "controls_and_attitude", "integrity", "navigation_errors", "profile_and_plan"]
