"""`ChannelKeys`: keys of a channel that mapping files and session files share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


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
