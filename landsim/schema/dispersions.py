"""What is drawn anew for each flight: the ``[dispersions]`` of a scenario."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from landsim.schema.base import LARGEST, Positive, Section, refused, tuple_from_list

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Distribution = Literal["normal", "truncated-normal", "uniform", "log-normal", "discrete"]

PARAMETERS: dict[Distribution, tuple[str, ...]] = {
    "normal": ("mean", "sigma"),
    "truncated-normal": ("mean", "sigma", "low", "high"),
    "uniform": ("low", "high"),
    "log-normal": ("median", "sigma_log"),
    "discrete": ("values", "weights"),
}
"""What each distribution is given by."""
OPTIONAL = {("truncated-normal", "low"), ("truncated-normal", "high"), ("discrete", "weights")}
"""Those that may be left out; of a truncated normal one of both."""

MOST_SIGMAS = 6.0
"""By which the mean of a truncated normal distribution may lie outside its ends; and as far to either side all that a
distribution without ends draws must be allowed.  One number in a billion lies farther out, of a batch of ten million
flights that of every hundredth batch: such a draw is refused before the batch flies.
"""


class DrawConfig(Section):
    """``[[dispersions.draw]]``: the distribution of one key."""

    key: str
    """Of any number in the scenario, such as ``camera.noise_px``."""
    distribution: Distribution
    apply: Literal["replace", "add", "multiply"] = "replace"
    """What the drawn number does to the scenario's: it takes its place, is added to it or multiplies it."""
    mean: Number | None = None
    sigma: Positive | None = None
    """Of a normal distribution; of a truncated one, those that it has before it is cut off.  Where there is no end,
    every value up to six sigma must be one that the key may have."""
    low: Number | None = None
    high: Number | None = None
    """Ends of a uniform distribution, or where a normal one is cut off."""
    median: Positive | None = None
    sigma_log: Annotated[float, Field(gt=0.0, le=10.0)] | None = None
    """Of the natural logarithm: 0.1 is about 10 %.  Six of them to either side must be allowed."""
    values: Annotated[tuple[Number, ...] | None, BeforeValidator(tuple_from_list)] = None
    weights: Annotated[tuple[Positive, ...] | None, BeforeValidator(tuple_from_list)] = None
    """In any scale; without them, every value is as likely as another."""

    @model_validator(mode="after")
    def _parameters_are_its_own(self) -> Self:
        own = PARAMETERS[self.distribution]
        for name in dict.fromkeys(name for names in PARAMETERS.values() for name in names):
            given = getattr(self, name) is not None
            if given and name not in own:
                theirs = " and ".join(kind for kind, names in PARAMETERS.items() if name in names)
                raise refused(f"belongs to {theirs}; {self.distribution} has {', '.join(own)}", name)
            if not given and name in own and (self.distribution, name) not in OPTIONAL:
                raise refused(f"is missing, which {self.distribution} needs", name)
        if self.distribution == "truncated-normal" and self.low is None and self.high is None:
            raise refused('is missing; without low and high the distribution is "normal"', "low")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise refused(f"must be above low = {self.low:g}, not {self.high:g}", "high")
        return self

    @model_validator(mode="after")
    def _something_is_left(self) -> Self:
        if self.distribution != "truncated-normal" or self.mean is None or self.sigma is None:
            return self
        for name, end, sign in (("low", self.low, 1.0), ("high", self.high, -1.0)):
            away = 0.0 if end is None else sign * (end - self.mean) / self.sigma
            if away > MOST_SIGMAS:
                told = f"is {away:.3g} sigma beyond the mean: next to nothing of the distribution is left; use uniform"
                raise refused(told, name)
        return self

    @model_validator(mode="after")
    def _values_have_weights(self) -> Self:
        if self.values is None:
            return self
        if not self.values:
            raise refused("must have at least one, not none", "values")
        if len(set(self.values)) < len(self.values):
            raise refused(f"must not repeat any, not {list(self.values)}", "values")
        if self.weights is not None and len(self.weights) != len(self.values):
            raise refused(f"must be as many as values, {len(self.values)}, not {len(self.weights)}", "weights")
        return self


class CorrelationConfig(Section):
    """``[[dispersions.correlation]]``: keys that are drawn together, by a Gaussian copula."""

    keys: Annotated[tuple[str, ...], BeforeValidator(tuple_from_list), Field(min_length=2)]
    """Each with a draw of its own, and in one group at most; none of them discrete."""
    matrix: Annotated[
        tuple[Annotated[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], BeforeValidator(tuple_from_list)], ...],
        BeforeValidator(tuple_from_list),
    ]
    """Correlation of their normal scores, which for normal distributions is that of the keys themselves."""

    @model_validator(mode="after")
    def _is_a_correlation(self) -> Self:
        import numpy as np

        size = len(self.keys)
        if len(set(self.keys)) < size:
            raise refused(f"must not repeat any, not {list(self.keys)}", "keys")
        if len(self.matrix) != size or any(len(row) != size for row in self.matrix):
            shape = " + ".join(str(len(row)) for row in self.matrix) or "no"
            raise refused(f"must be {size} rows of {size} numbers, as there are keys, not {shape}", "matrix")
        for i in range(size):
            if self.matrix[i][i] != 1.0:
                raise refused(f"must have 1 on the diagonal, not {self.matrix[i][i]:g}", f"matrix[{i}][{i}]")
            for j in range(i):
                if self.matrix[i][j] != self.matrix[j][i]:
                    told = f"must be symmetric: {self.matrix[i][j]:g} here, but {self.matrix[j][i]:g} at [{j}][{i}]"
                    raise refused(told, f"matrix[{i}][{j}]")
        least = float(np.linalg.eigvalsh(np.array(self.matrix)).min())
        if least < 1e-9:
            told = f"must be positive definite; its least eigenvalue is {least:.3g}: some of the correlations exclude"
            raise refused(f"{told} each other, or one key is the copy of others", "matrix")
        return self


class DispersionsConfig(Section):
    """``[dispersions]``: keys whose values are drawn for each flight."""

    sampling: Literal["random", "latin-hypercube", "sobol"] = "random"
    """Of a batch: each flight by its own seed alone, or a design that fills the space more evenly."""
    draw: Annotated[tuple[DrawConfig, ...], BeforeValidator(tuple_from_list), Field(min_length=1)]
    correlation: Annotated[tuple[CorrelationConfig, ...], BeforeValidator(tuple_from_list)] = ()

    @model_validator(mode="after")
    def _groups_are_of_draws(self) -> Self:
        places: dict[str, int] = {}
        for i, draw in enumerate(self.draw):
            if draw.key in places:
                raise refused(f"{draw.key} is drawn already, by draw[{places[draw.key]}]", f"draw[{i}].key")
            places[draw.key] = i
        grouped: dict[str, int] = {}
        for i, group in enumerate(self.correlation):
            for j, key in enumerate(group.keys):
                place = f"correlation[{i}].keys[{j}]"
                if key not in places:
                    raise refused(f"{key} is not drawn; drawn are {', '.join(places)}", place)
                if key in grouped:
                    raise refused(f"{key} is in correlation[{grouped[key]}] already: one group, one matrix", place)
                if self.draw[places[key]].distribution == "discrete":
                    raise refused(f"{key} is discrete: only continuous distributions are correlated", place)
                grouped[key] = i
        return self
