"""`Channel`: name, quantity, unit and place of one column of samples."""

from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import SI_UNITS, DegreeOfFreedom, FileFormatError, InputError

from .settings import SETTINGS

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)  # for every table of a TOML file
Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(min_length=1)]


@dataclass(frozen=True)
class Channel:
    """One measured quantity at one degree of freedom, in SI units.

    Parameters
    ----------
    name
        Short name, unique in its recording, such as ``fx``.
    quantity
        One of :data:`millfrf.core.SI_UNITS` (``force``, ``acceleration`` ...).
    unit
        The SI unit of that quantity.
    node, direction
        Degree of freedom, such as ``TCP`` and ``+X``. Both are empty for channels without one (a tachometer).
    full_scale
        Largest magnitude of the input, in ``unit``; samples that reach it are overloaded. None: unknown.
    high_pass_hz
        Corner frequency of the sensor's first-order high-pass (IEPE), Hz. None: no high-pass is known.
    sensor
        Model and serial number, free text.
    input_delay_s
        Known delay of the input or amplifier, s. Samples are stored as they came; spectra, fits and diagnoses
        compensate the delay. None: no delay is known.
    extra
        Further keys of the file; they are kept and not interpreted.

    Raises
    ------
    InputError
        Unknown quantity, a unit that is not its SI unit, an empty name, a malformed direction, or a delay below 0 or
        above 1 s.

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
        longest = SETTINGS.longest_input_delay
        if self.input_delay_s is not None and not 0 <= self.input_delay_s <= longest:
            raise InputError(
                f"channel {self.name}: input delay {self.input_delay_s!r} s must be between 0 and {longest:g} s; "
                "take it from the module's data sheet"
            )
        if bool(self.node) != bool(self.direction):
            lacking, example = ("direction", "+X") if self.node else ("node", "TCP, the tool tip")
            given = f"node {self.node}" if self.node else f"direction {self.direction}"
            raise InputError(
                f"channel {self.name}: {given} without a {lacking}; give its {lacking}, such as {example}, or leave "
                "both out"
            )
        if self.node:
            DegreeOfFreedom(self.node, self.direction)  # refuses what is no degree of freedom

    @property
    def degree_of_freedom(self) -> str:
        """Return ``node:direction``, or the channel's name if it has no node."""
        return f"{self.node}:{self.direction}" if self.node else self.name

    def to_json(self) -> dict[str, Any]:
        """Return the fields as the recording format stores them, without empty fields."""
        stored = {key: value for key, value in asdict(self).items() if key != "extra" and value not in ("", None)}
        return {**self.extra, **stored}

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> "Channel":
        """Make a channel from the fields that :meth:`to_json` gave; unknown keys go to ``extra``.

        Raises
        ------
        FileFormatError
            ``name``, ``quantity`` or ``unit`` is missing.
        """
        required = ("name", "quantity", "unit")
        if not isinstance(stored, dict) or not all(isinstance(stored.get(key), str) for key in required):
            raise FileFormatError(
                f"channel description {stored!r} lacks name, quantity or unit; write the recording again"
            )
        names = {entry.name for entry in fields(cls)} - {"extra"}
        known = {key: value for key, value in stored.items() if key in names}
        extra = {key: value for key, value in stored.items() if key not in names}
        return cls(**known, extra=extra)


class ChannelKeys(BaseModel):
    """Measured quantity and place of a channel: the keys that session and mapping files share.

    Parameters
    ----------
    name
        Name of the channel in the recording.
    quantity
        Measured quantity: ``force``, ``acceleration``, ``velocity``, ``displacement``, ``moment``, ``angle``,
        ``angular_velocity``, ``voltage``, ``temperature`` or ``dimensionless``.
    node
        Point of the machine at which the sensor is mounted: ``TCP`` is the tool tip, ``HOUSING`` the spindle housing,
        other names are free. Motions measured at the tip are ``TCP`` and need no ``calibrate``; those at ``HOUSING``
        do.
    direction
        Axis and sense in which the sensor counts positive, such as ``+X`` or ``-Z``.
    high_pass_hz : Hz
        Corner frequency of the first-order high-pass of sensor or amplifier. ``estimate``, ``fit`` and diagnoses
        compensate it; ``tap`` compensates that of responses.
    sensor
        Type and serial number, for the reader.
    """

    model_config = STRICT

    name: Name
    quantity: str
    node: str = ""
    direction: str = ""
    high_pass_hz: Positive | None = None
    sensor: str = ""
