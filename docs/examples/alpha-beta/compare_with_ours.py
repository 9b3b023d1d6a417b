"""Fly the plug-ins and landsim's own on the same seeds, and print what came of it as a Markdown table."""

import math
import sys

from scipy.stats import binomtest

from landsim import fly, load_scenario

CHOICES = (("landsim", "landsim"), ("alpha-beta", "landsim"), ("landsim", "even-flare"))
ERRORS = ("along_m", "cross_m", "height_m", "roll_deg")


def row(estimator: str, controller: str, flights: int) -> list[str]:
    """The cells of a table's row, over the seeds from 0 on."""
    scenario = load_scenario("landing", {"plug-ins.estimator": estimator, "plug-ins.controller": controller})
    flown = [fly(scenario, seed).metrics for seed in range(flights)]
    good = sum(metrics["in_box"] for metrics in flown)
    low, high = binomtest(good, flights).proportion_ci(method="exact")
    down = [metrics["touchdown"] for metrics in flown if metrics["touchdown"]]
    sinks, places = [t["sink_rate_mps"] for t in down], [t["x_m"] for t in down]
    off = max(abs(t["y_m"]) for t in down)
    errors = [[metrics["navigation"]["fused"][name]["rms"] for metrics in flown] for name in ERRORS]
    rms = [math.sqrt(sum(e**2 for e in of) / len(of)) for of in errors]
    return [
        estimator,
        controller,
        f"{good} of {flights} ({100 * low:.0f} to {100 * high:.0f} %)",
        f"{min(places):.0f} to {max(places):.0f}",
        f"{off:.2f}",
        f"{min(sinks):.2f} to {max(sinks):.2f}",
        *(f"{value:.2f}" for value in rms),
    ]


def main(flights: int) -> None:
    """Print the table."""
    head = ["estimator", "controller", "in the box (95 %)", "touchdown m", "most off m", "sink m/s"]
    head += [f"rms {name.replace('_m', ' m').replace('_deg', ' °')}" for name in ERRORS]
    for cells in (head, ["---"] * len(head), *(row(*choice, flights) for choice in CHOICES)):
        print("|", " | ".join(cells), "|")


if __name__ == "__main__":
    main(int(sys.argv[1]))
