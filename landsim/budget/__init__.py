"""Budgets of line precision: from bounds on the pose's errors back to what the image lines must be worth.

::

    typed          a name and what it is to be, as typed
    requirements   bounds at ranges, as given
    setting        camera, runway and approach, and what is seen on the way
    bias           what a wrong roll angle makes of the late pose
    normal         a normal error about a shift, and bounds on its size
    solve          the precision needed, to first order in the noise
    drawn          what becomes of it when the noise is drawn
    course         where on the approach a bound holds with a given precision
    sweep          the same when one thing about camera, runway or approach is another
    result         all of it, as JSON-ready data
    order          from what is typed to all that is asked for, and the files of a budget
    words          what a table and a figure say of it

The estimator's errors and the straight approach are those of ``landsim.study``.
"""

from landsim.budget.requirements import Requirement, parse_requirement, read_requirements
from landsim.budget.result import Budget, Order, as_dict, make_budget, steps
from landsim.budget.setting import Setting, setting_of
from landsim.budget.sweep import DEFAULT_SWEEPS, PARAMETERS, Sweep, SweepOrder, parse_sweep

__all__ = [
    "DEFAULT_SWEEPS",
    "PARAMETERS",
    "Budget",
    "Order",
    "Requirement",
    "Setting",
    "Sweep",
    "SweepOrder",
    "as_dict",
    "make_budget",
    "parse_requirement",
    "parse_sweep",
    "read_requirements",
    "setting_of",
    "steps",
]
