"""Tables of TOML files that hold the options of a step, made from its signature and docstring."""

import inspect
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, ClassVar, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, create_model, model_validator

from .steps import Option, Reads, Writes, alternatives, describe

UNITS_OF_KEYS = {
    "s": "s",
    "Hz": "hz",
    "rpm": "rpm",
    "m": "m",
    "mm": "mm",
    "deg": "deg",
    "kg": "kg",
    "N": "n",
    "rad": "rad",
}
"""Units of options as they end a key."""


class StepTable(BaseModel):
    """Options of a step as a table of a TOML file, made by :func:`table_of`."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
    parameters: ClassVar[Mapping[str, str]] = {}

    @property
    def options(self) -> dict[str, Any]:
        """Values by the names of the step's parameters."""
        return {name: getattr(self, key) for key, name in self.parameters.items()}

    @model_validator(mode="after")
    def _bands_are_not_empty(self) -> "StepTable":
        for key in self.parameters:
            band = getattr(self, key)
            if key.startswith("band") and band is not None and not band[0] < band[1]:
                raise ValueError(f"{key} [{band[0]:g}, {band[1]:g}] is empty; give [LOW, HIGH]")
        return self


def key_of(option: Option) -> str:
    """Return the key of a step's option in a TOML file: the name as typed, with its unit at the end.

    Parameters
    ----------
    option
        Option of a step.
    """
    name = option.typed.removeprefix("--").replace("-", "_") if not option.positional else option.name
    unit = UNITS_OF_KEYS.get(option.unit, "")
    return f"{name}_{unit}" if unit and not name.endswith(f"_{unit}") else name


def table_of(
    function: Callable[..., Any],
    name: str,
    *,
    base: type[StepTable] = StepTable,
    without: Collection[str] = (),
    needed: Collection[str] = (),
    former: Mapping[str, str] | None = None,
) -> type[StepTable]:
    """Make the class of a TOML table with the options of a step.

    Names, types, bounds, defaults, units and meanings are taken from the step's signature and docstring. A key ends
    with the unit of its option; a file may also contain the name without the unit.

    Parameters
    ----------
    function
        The step.
    name
        Name of the table's class.
    base
        Base class with further keys.
    without
        Parameters that the table does not have, because the program sets them.
    needed
        Parameters that the table requires although the step has a default.
    former
        Keys of earlier versions that are read as well, by their present parameter.
    """
    described = describe(inspect.unwrap(function))
    fields: dict[str, Any] = {}
    keys: dict[str, str] = {}
    lines = [f"{described.summary}", "", "Parameters", "----------"]
    for option in described.options:
        if option.name in without or isinstance(option.marker, Writes) or not option.public:
            continue
        key = key_of(option)
        kind = _kind_of_key(option)
        aliases = dict.fromkeys(
            [key, option.name, option.typed.lstrip("-").replace("-", "_"), (former or {}).get(option.name, key)]
        )
        alias = AliasChoices(*aliases)
        if option.name in needed or option.default is inspect.Parameter.empty:
            fields[key] = (kind, Field(validation_alias=alias))
        else:
            fields[key] = (
                kind | None if option.default is None else kind,
                Field(option.default, validation_alias=alias),
            )
        keys[key] = option.name
        lines += [f"{key} : {option.unit}" if option.unit else key, f"    {option.text}"]
    table = create_model(name, __base__=base, __doc__="\n".join(lines), **fields)
    table.parameters = keys
    return table


def _kind_of_key(option: Option) -> Any:
    """Return the type of a key with its bounds, for a tuple with the bounds of each entry.

    Files become texts, and names become lists of texts.
    """
    if isinstance(option.marker, Reads):
        return str
    kinds = alternatives(option.kind)
    bounds = [marker for marker in option.markers if isinstance(marker, Gt | Ge | Lt | Le)]
    if len(kinds) != 1 or not bounds:
        return kinds[0] if len(kinds) == 1 else option.kind
    if get_origin(kinds[0]) is tuple:
        return tuple.__class_getitem__(tuple(Annotated[entry, *bounds] for entry in get_args(kinds[0])))
    return Annotated[kinds[0], *bounds]
