"""What every section of a file is made of: the frozen model, common ranges, and a model's keys by name."""

from collections.abc import Iterator
from typing import Annotated, Any, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from landsim.errors import OWN_CHECK


def tuple_from_list(value: Any) -> Any:
    """TOML has arrays; a frozen model holds tuples."""
    return tuple(value) if isinstance(value, list) else value


def refused(message: str, key: str | None = None) -> PydanticCustomError:
    """What a check over several keys raises: a complete message and the dotted key to name, seen from the model."""
    return PydanticCustomError(OWN_CHECK, "{message}", {"message": message, "key": key or ""})


LARGEST = 1e6
"""No quantity of a landing is larger, in any of the units that are used."""
Positive = Annotated[float, Field(gt=0.0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
HeadingDeg = Annotated[float, Field(ge=-360.0, le=360.0)]
PointM = Annotated[tuple[float, float, float], BeforeValidator(tuple_from_list)]
WindowS = Annotated[tuple[NotNegative, NotNegative], BeforeValidator(tuple_from_list)]


class Section(BaseModel):
    """A table of a file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)


def section_of(annotation: Any) -> type[Section] | None:
    """The model of a field that holds a table, or may hold one, or an array of them."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next((kind for kind in map(section_of, get_args(annotation)) if kind is not None), None)


def fields_by_key(model: type[Section]) -> dict[str, str]:
    """The keys of a table, in the file's order, and the names of the fields that hold them."""
    return {field.alias or name: name for name, field in model.model_fields.items()}


def field_names(model: type[Section], place: tuple[int | str, ...]) -> list[str]:
    """The keys that are right in the table at a place below a model."""
    for key in place:
        if isinstance(key, int):  # of an array of tables, any of which has the same keys
            continue
        name = fields_by_key(model).get(key)
        inner = section_of(model.model_fields[name].annotation) if name else None
        if inner is None:
            return []
        model = inner
    return list(fields_by_key(model))


def rows(section: Section, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Dotted key and value of everything in a model, in the file's order."""
    for name, field in fields_by_key(type(section)).items():
        value = getattr(section, field)
        if isinstance(value, Section):
            yield from rows(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
