"""Broken files as laboratories have them.

- truncated: the copy from the measuring computer broke off;
- no HDF5 file: a table was exported under the recording's name;
- damaged block: a bad sector of the disk, zeros inside the samples;
- clipped: the charge amplifier of one force stood in too small a range, which the file does not state;
- wrong posture: the notes are those of another pose.

The last two are made before the file is written: see :mod:`millfrf.campaign.simulated.recordings`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from replay_data import MillingCell, Sensor

KEPT = 0.55
"""Share of a truncated file that is left."""

SECTOR = 4096
"""Bytes of a bad sector."""

CLIPPED_AT = 0.5
"""Full scale of the clipped force over its largest value."""

CLIPPED = "fy"


def clipped_sensors(cell: MillingCell) -> tuple[Sensor, ...]:
    """The cell's sensors with a range of one force that its peaks pass."""
    names = [sensor.name for sensor in cell.sensors]
    peak = float(np.abs(cell.samples()[:, names.index(CLIPPED)]).max())
    return tuple(
        replace(sensor, full_scale=round(CLIPPED_AT * peak, 1)) if sensor.name == CLIPPED else sensor
        for sensor in cell.sensors
    )


def spoil(path: Path, fault: str | None, cell: MillingCell) -> None:
    """Spoil a recording of a cell that was written whole."""
    if fault == "no HDF5 file":
        names = ";".join(sensor.name for sensor in cell.sensors)
        np.savetxt(path, cell.samples(), fmt="%.4f", delimiter=";", header=names, comments="")
        return
    content = path.read_bytes()
    if fault == "truncated":
        path.write_bytes(content[: int(KEPT * len(content))])
    elif fault == "damaged block":
        middle = len(content) // 2 // SECTOR * SECTOR
        path.write_bytes(content[:middle] + bytes(SECTOR) + content[middle + SECTOR :])
