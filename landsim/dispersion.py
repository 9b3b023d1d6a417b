"""What a scenario's ``[dispersions]`` draw for each flight.

A draw begins with numbers between 0 and 1, one for each key, from the seed or from a design for the whole batch.  Keys
in a correlated group are mixed by a Gaussian copula: with z = Φ⁻¹(u) and L Lᵀ the group's correlation matrix, u becomes
Φ(L z).  The inverse of each key's distribution function makes the drawn number of u, and that replaces, is added to or
multiplies what the scenario says.

The numbers of a flight are worked out one by one, for one flight at a time, so that they are the same bits whoever asks
for them and however many.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from numpy.random import Generator, SeedSequence, default_rng

from estimator.so3 import Array
from landsim.config import Scenario
from landsim.errors import ScenarioError
from landsim.scene import loading_of
from landsim.schema import DispersionsConfig, DrawConfig, applied, drawable, refusal, value_of, with_values
from landsim.schema.drawn import without_value
from landsim.truth import Loading

BRANCH = 0x64697370
"""Of a flight's seed that is the dispersions' own: far from those that the flight counts off from 0."""
RANDOM, LATIN_HYPERCUBE, SOBOL = range(3)
"""Twigs of that branch, one for each way of sampling."""
LEAST, MOST = 2.0**-54, 1.0 - 2.0**-53
"""Numbers between 0 and 1 are kept off both, where an unbounded distribution has no value."""
SOBOL_BITS = 52
"""Of a Sobol sequence's coordinates: with scipy's 30, a batch of 100,000 may well hold a 0."""

Quantile = Callable[[float], float]


class _Group(NamedTuple):
    """Keys that are drawn together."""

    places: list[int]
    """Of its keys among all."""
    factor: list[list[float]]
    """Rows of the lower Cholesky factor, each up to its diagonal."""


class _Plan(NamedTuple):
    """Everything that makes values of numbers between 0 and 1."""

    draws: tuple[DrawConfig, ...]
    own: list[float | None]
    """What each key has in the scenario."""
    quantiles: list[Quantile]
    groups: list[_Group]

    def values(self, numbers: Sequence[float]) -> dict[str, float]:
        from scipy.special import ndtr, ndtri

        u = [min(max(number, LEAST), MOST) for number in numbers]
        for places, factor in self.groups:
            scores = [float(ndtri(u[place])) for place in places]
            for place, row in list(zip(places, factor, strict=True))[1:]:  # the first is as it was
                score = sum(a * z for a, z in zip(row, scores, strict=False))
                u[place] = min(max(float(ndtr(score)), LEAST), MOST)
        return {
            draw.key: applied(draw, own, quantile(number))
            for draw, own, quantile, number in zip(self.draws, self.own, self.quantiles, u, strict=True)
        }


def keys_of(scenario: Scenario) -> tuple[str, ...]:
    """Dotted keys that are drawn, in the file's order; none without dispersions."""
    return () if scenario.dispersions is None else tuple(draw.key for draw in scenario.dispersions.draw)


def draws_of_seed(scenario: Scenario, seed: int) -> dict[str, float]:
    """The values that a flight with a seed has by plain random sampling.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Not negative.

    Returns
    -------
    dict of str to float
        By key; empty without dispersions.  A key that is added at the end of the file leaves those before it as they
        are.
    """
    if scenario.dispersions is None:
        return {}
    return _plan(scenario, scenario.dispersions).values(_random(seed, len(scenario.dispersions.draw)))


class Design:
    """The values of all flights of a batch, by the scenario's own way of sampling.

    ``random`` draws each flight by its seed alone, as `draws_of_seed` does for seed + index.  ``latin-hypercube`` puts
    one flight into each of n equally probable slices of every key (M. D. McKay et al., Technometrics 21, 1979); of a
    correlated group the first key alone keeps its slices exactly.  ``sobol`` takes the flights from a scrambled Sobol
    sequence (A. B. Owen, Journal of Complexity 14, 1998), whose first points are the same for any n; it is
    balanced when n is a power of two.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of the batch, not negative.
    n : int
        Of flights, at least 1.

    Raises
    ------
    ValueError
        If n is below 1.
    """

    def __init__(self, scenario: Scenario, seed: int, n: int) -> None:
        if n < 1:
            raise ValueError(f"a design must be of at least one flight, not {n}")
        self.n = n
        self._seed = seed
        config = scenario.dispersions
        self._plan = None if config is None else _plan(scenario, config)
        self._points = None if config is None else _points(config, seed, n)

    def draws(self, index: int) -> dict[str, float]:
        """The values of one flight by key; empty without dispersions.

        Raises
        ------
        IndexError
            If the batch has no such flight.
        """
        if not 0 <= index < self.n:
            raise IndexError(f"a batch of {self.n} flights has no flight {index}")
        if self._plan is None:
            return {}
        if self._points is None:
            return self._plan.values(_random(self._seed + index, len(self._plan.draws)))
        return self._plan.values(self._points[index].tolist())


def dispersed(scenario: Scenario, draws: Mapping[str, float]) -> Scenario:
    """The scenario with drawn values, validated again, and without dispersions.

    Raises
    ------
    ScenarioError
        If a value is refused: file, draw, value, limit.
    """
    if scenario.dispersions is None and not draws:
        return scenario
    _must_be_keys(scenario, draws)
    wrong = refusal(scenario, draws)
    if wrong is not None:
        raise ScenarioError(f"{scenario.path}: {_told(scenario, draws, *wrong)}")
    return with_values(scenario, draws)


def check_draws(scenario: Scenario, draws: Iterable[Mapping[str, float]]) -> None:
    """Refuse a batch of which a flight has a value that the scenario does not allow, before any is flown.

    Parameters
    ----------
    scenario : Scenario
    draws : iterable of mapping
        Of every flight, in the order of the batch.

    Raises
    ------
    ScenarioError
        One line: file, flight, draw, value, limit, and what to do.
    """
    for index, values in enumerate(draws):
        _must_be_keys(scenario, values)
        wrong = refusal(scenario, values)
        if wrong is not None:
            raise ScenarioError(f"{scenario.path}: flight {index} of the batch: {_told(scenario, values, *wrong)}")


def loading_to_offer(scenario: Scenario) -> Loading:
    """A loading that asks of the aircraft's model what any flight of the scenario does: more than none, if any does."""
    if any(key.startswith("loading.") for key in keys_of(scenario)):
        return Loading(extra_mass=1.0)
    return loading_of(scenario)


def described(scenario: Scenario) -> list[str]:
    """A line for each draw: its key, its distribution, and the values below which 5, 50 and 95 % of it lie."""
    config = scenario.dispersions
    if config is None:
        return []
    plan = _plan(scenario, config)
    width = max(len(draw.key) for draw in config.draw)
    lines = []
    for draw, own, quantile in zip(plan.draws, plan.own, plan.quantiles, strict=True):
        if draw.values is not None:
            weights = draw.weights or (1.0,) * len(draw.values)
            shares = [
                f"{applied(draw, own, v):g} ({w / sum(weights):.0%})" for v, w in zip(draw.values, weights, strict=True)
            ]
            shown = f"one of {', '.join(shares)}"
        else:
            spread = sorted(applied(draw, own, quantile(share)) for share in (0.05, 0.5, 0.95))
            shown = "5, 50, 95 %: " + ", ".join(f"{value:.4g}" for value in spread)
        to = {"replace": "", "add": f" added to {own:g}", "multiply": f" times {own:g}"}[draw.apply]
        lines.append(f"{draw.key:<{width}}  {draw.distribution}{to}; {shown}")
    lines += [f"correlated: {', '.join(group.keys)}" for group in config.correlation]
    return [*lines, f"sampling: {config.sampling}"]


def _random(seed: int, number: int) -> list[float]:
    numbers: list[float] = _branch(seed, RANDOM).random(number).tolist()
    return numbers


def _branch(seed: int, *twig: int) -> Generator:
    return default_rng(SeedSequence(seed, spawn_key=(BRANCH, *twig)))


def _points(config: DispersionsConfig, seed: int, n: int) -> Array | None:
    """Numbers between 0 and 1 (n, keys) of a design; None for plain random ones."""
    if config.sampling == "random":
        return None
    from scipy.stats import qmc

    keys = len(config.draw)
    if config.sampling == "latin-hypercube":
        points: Array = qmc.LatinHypercube(keys, rng=_branch(seed, LATIN_HYPERCUBE, n)).random(n)
        return points
    # drawn up to a power of two, at which scipy finds it balanced; the first points do not depend on that
    sequence = qmc.Sobol(keys, bits=SOBOL_BITS, rng=_branch(seed, SOBOL))
    first: Array = sequence.random_base2((n - 1).bit_length())[:n]
    return first


def _plan(scenario: Scenario, config: DispersionsConfig) -> _Plan:
    import numpy as np

    places = {draw.key: place for place, draw in enumerate(config.draw)}
    groups = []
    for group in config.correlation:
        factor = np.linalg.cholesky(np.array(group.matrix)).tolist()
        groups.append(_Group([places[key] for key in group.keys], [row[: i + 1] for i, row in enumerate(factor)]))
    own = [value_of(scenario, draw.key) for draw in config.draw]
    return _Plan(config.draw, own, [quantile_of(draw) for draw in config.draw], groups)


def quantile_of(draw: DrawConfig) -> Quantile:
    """The inverse of a draw's distribution function, for numbers between 0 and 1, both excluded."""
    from scipy.special import ndtri

    if draw.values is not None:
        return _discrete(draw.values, draw.weights or (1.0,) * len(draw.values))
    if draw.median is not None and draw.sigma_log is not None:
        median, sigma_log = draw.median, draw.sigma_log
        return lambda u: median * math.exp(sigma_log * float(ndtri(u)))
    if draw.mean is not None and draw.sigma is not None:
        mean, sigma = draw.mean, draw.sigma
        if draw.distribution == "truncated-normal":
            return _truncated(mean, sigma, draw.low, draw.high)
        return lambda u: mean + sigma * float(ndtri(u))
    assert draw.low is not None
    assert draw.high is not None
    low, width = draw.low, draw.high - draw.low
    return lambda u: low + width * u


def _truncated(mean: float, sigma: float, low: float | None, high: float | None) -> Quantile:
    """Of the normal distribution between two ends, at mean + σ Φ⁻¹(Φ(a) + u (Φ(b) - Φ(a))).

    An interval above the mean is taken by its mirror image below it, where Φ has all its digits.
    """
    from scipy.special import ndtr, ndtri

    least, most = (-math.inf if low is None else low), (math.inf if high is None else high)
    a, b = (least - mean) / sigma, (most - mean) / sigma
    mirrored = a > 0.0
    if mirrored:
        a, b = -b, -a
    below, share = float(ndtr(a)), float(ndtr(b)) - float(ndtr(a))

    def quantile(u: float) -> float:
        score = float(ndtri(below + ((1.0 - u) if mirrored else u) * share))
        return min(max(mean + sigma * (-score if mirrored else score), least), most)

    return quantile


def _discrete(values: Sequence[float], weights: Sequence[float]) -> Quantile:
    """The values in their order, each over its share of 0 to 1."""
    from bisect import bisect_right
    from itertools import accumulate

    ends = list(accumulate(weights))
    return lambda u: values[min(bisect_right(ends, u * ends[-1]), len(values) - 1)]


def _must_be_keys(scenario: Scenario, draws: Mapping[str, float]) -> None:
    known = keys_of(scenario) if scenario.dispersions is not None else tuple(drawable(type(scenario)))
    strange = [key for key in draws if key not in known]
    missing = [key for key in keys_of(scenario) if key not in draws]
    if strange or missing:
        raise ValueError(f"draws must be of the scenario's dispersed keys; {(strange or missing)[0]} is not")


def _told(scenario: Scenario, values: Mapping[str, float], key: str, what: str) -> str:
    """What is wrong with the values of a flight, and what would be right."""
    config = scenario.dispersions
    own = [i for i, draw in enumerate(config.draw) if draw.key == key] if config is not None else []
    if config is None or not own:
        section = key.partition(".")[0]
        near = {name: value for name, value in values.items() if name in what or name.startswith(f"{section}.")}
        return f"{key} {what}, with " + ", ".join(f"{name} = {value:g}" for name, value in (near or values).items())
    draw = config.draw[own[0]]
    open_ended = draw.distribution in {"normal", "log-normal"} or None in {draw.low, draw.high}
    advice = '; use "truncated-normal", with low and high, or "uniform"' if open_ended and draw.values is None else ""
    return f"dispersions.draw[{own[0]}] gives {key} = {values[key]:g}, which {without_value(what)}{advice}"
