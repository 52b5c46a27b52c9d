"""`Channel`: name, quantity, unit and place of one column of samples."""

from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import SI_UNITS, DegreeOfFreedom, FileFormatError, InputError

_FIELDS = ("name", "quantity", "unit", "node", "direction", "full_scale", "high_pass_hz", "sensor", "input_delay_s")

LONGEST_DELAY = 1.0
"""Largest delay of an input that is believed, s."""


@dataclass(frozen=True)
class Channel:
    """One measured quantity at one degree of freedom, in SI units.

    Parameters
    ----------
    name
        Short name, unique in its recording: ``fx``, ``ax``.
    quantity
        One of :data:`millfrf.core.SI_UNITS` (``force``, ``acceleration`` ...).
    unit
        The SI unit of that quantity.
    node, direction
        Degree of freedom (``TCP``, ``+X``); both empty for channels without one (a tachometer).
    full_scale
        Largest magnitude the input can hold, in ``unit``; samples at it are overloaded. None: unknown.
    high_pass_hz
        Corner of the sensor's first-order high-pass (IEPE), Hz. None: none known.
    sensor
        Model and serial number, free text.
    input_delay_s
        Time by which its samples come late, known of its input or amplifier, s. The samples are stored as they came;
        spectra, fits and diagnoses take it out. None: none known.
    extra
        Whatever else a file says of the channel; kept, not interpreted.

    Raises
    ------
    InputError
        Unknown quantity, a unit that is not the SI one, an empty name, a malformed direction, or a delay
        below 0 or over 1 s.

    Examples
    --------
    >>> Channel("fx", "force", "N", "TCP", "+X").degree_of_freedom
    'TCP:+X'
    """

    name: str
    quantity: str
    unit: str
    node: str = ""
    direction: str = ""
    full_scale: float | None = None
    high_pass_hz: float | None = None
    sensor: str = ""
    input_delay_s: float | None = None
    extra: dict[str, Any] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("a channel has an empty name; give each channel a unique name such as fx")
        expected = SI_UNITS.get(self.quantity)
        if expected is None:
            raise InputError(
                f"channel {self.name}: unknown quantity {self.quantity!r}; use one of {', '.join(SI_UNITS)}"
            )
        if self.unit != expected:
            raise InputError(
                f"channel {self.name}: unit {self.unit!r} is not {expected!r}, the SI unit of {self.quantity}; "
                "convert when importing"
            )
        if self.input_delay_s is not None and not 0 <= self.input_delay_s <= LONGEST_DELAY:
            raise InputError(
                f"channel {self.name}: input delay {self.input_delay_s!r} s must be between 0 and {LONGEST_DELAY:g} s; "
                "take it from the module's data sheet"
            )
        if self.node or self.direction:
            DegreeOfFreedom(self.node, self.direction)

    @property
    def degree_of_freedom(self) -> str:
        """``node:direction``, or the channel's name where it has no place."""
        return f"{self.node}:{self.direction}" if self.node else self.name

    def to_json(self) -> dict[str, Any]:
        """The channel as the recording format stores it; empty fields are left out."""
        known = {key: value for key, value in asdict(self).items() if key != "extra" and value not in ("", None)}
        return {**self.extra, **known}

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> "Channel":
        """Read what :meth:`to_json` wrote; unknown keys go to ``extra``.

        Raises
        ------
        FileFormatError
            ``name``, ``quantity`` or ``unit`` is missing.
        """
        if not isinstance(stored, dict) or not all(
            isinstance(stored.get(k), str) for k in ("name", "quantity", "unit")
        ):
            raise FileFormatError(
                f"channel description {stored!r} lacks name, quantity or unit; write the recording anew"
            )
        known = {key: stored[key] for key in _FIELDS if key in stored}
        extra = {key: value for key, value in stored.items() if key not in _FIELDS}
        return cls(**known, extra=extra)


class ChannelKeys(BaseModel):
    """What a channel measures, and where.

    Parameters
    ----------
    name
        Name of the channel in the recording.
    quantity
        What it measures: ``force``, ``acceleration``, ``velocity``, ``displacement``, ``moment``, ``angle``,
        ``angular_velocity``, ``voltage``, ``temperature`` or ``dimensionless``.
    node
        Point of the machine where the sensor sits: ``TCP`` is the tool's tip, ``HOUSING`` the spindle's housing, others
        are free. Motions measured at the tip are ``TCP`` and need no ``calibrate``; those at ``HOUSING`` do.
    direction
        Axis and sense in which the sensor counts positive, such as ``+X`` or ``-Z``.
    high_pass_hz : Hz
        Corner of the sensor's or amplifier's high-pass, of first order; ``estimate``, ``fit`` and diagnoses take its
        effect out, ``tap`` that of responses.
    sensor
        Type and serial number, for the reader.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(min_length=1)]
    quantity: str
    node: str = ""
    direction: str = ""
    high_pass_hz: Annotated[float, Field(gt=0)] | None = None
    sensor: str = ""
