"""Figures for print: the measures of a paper's column, letters that stay legible in it, PNG and PDF of the same bytes.

A figure is made at the size at which it is printed, so that its letters are as large on paper as they are said to be.
"""

from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from landsim.plots.style import STYLE

CM = 1.0 / 2.54
"""A centimetre in inches."""
COLUMN, PAGE = 8.5 * CM, 17.5 * CM
"""Width of one column and of two, inches."""
DPI = 220
"""Of the PNG."""
PRINTED: Any = {
    **STYLE,
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.titlepad": 3.0,
    "axes.labelsize": 7.5,
    "axes.labelpad": 2.0,
    "axes.linewidth": 0.6,
    "axes.grid": False,
    "legend.fontsize": 7.0,
    "legend.markerscale": 1.6,
    "legend.handlelength": 2.2,
    "legend.labelspacing": 0.35,
    "legend.handletextpad": 0.6,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "pdf.fonttype": 42,
}
"""Letters of at least 7 points, and fonts embedded whole enough to be edited: some journals take no others."""
UNDATED: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "ModDate": None},
}


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write ``<name>.png`` and ``<name>.pdf``, each beside its place and then renamed.

    Neither holds a date: the same figure makes the same bytes.

    Parameters
    ----------
    figure : Figure
    folder : Path
        Exists.
    name : str
        Without an ending.

    Returns
    -------
    list of Path
    """
    paths = []
    for ending, metadata in UNDATED.items():
        path = folder / f"{name}.{ending}"
        beside = path.with_name(f".{path.name}.part")
        try:
            with rc_context(PRINTED):
                figure.savefig(beside, format=ending, dpi=DPI, metadata=metadata)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
        paths.append(path)
    return paths
