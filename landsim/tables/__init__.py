"""The tables that the command line prints at the end: of a flight, a study, a budget and a batch.

In a narrow terminal their columns go below each other.
"""

from landsim.tables.batch import batch_tables, compare_tables
from landsim.tables.budget import budget_tables
from landsim.tables.flight import flight_tables
from landsim.tables.sheet import NARROWEST, number
from landsim.tables.study import study_tables

__all__ = ["NARROWEST", "batch_tables", "budget_tables", "compare_tables", "flight_tables", "number", "study_tables"]
