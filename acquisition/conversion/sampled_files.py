"""Files that state their own sample rate: WAV sound and time records of the Universal File Format (data set 58)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError

from .uff import read_uff_sets

_TIME_RESPONSE = 1
_TRANSLATIONS = {1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}

Real = NDArray[np.float64]


def read_wav(path: Path) -> tuple[dict[str, Any], float]:
    """Samples as the array ``wav`` (n_samples, n_channels), 1 at full scale, and the rate, Hz.

    Integers are divided by the largest of their size; floats are taken as they are.

    Raises
    ------
    FileFormatError
        No whole WAV file, or one without a rate.
    """
    from scipy.io import wavfile

    try:
        rate, stored = wavfile.read(path)
    except UnboundLocalError as error:  # what scipy says of a file without samples
        raise FileFormatError(f"{path} holds no samples; it is cut short, record or export it anew") from error
    if not rate > 0:
        raise FileFormatError(f"{path} states a sample rate of {rate}; convert it anew")
    if stored.dtype == np.uint8:
        values = (stored.astype(np.float64) - 128.0) / 128.0
    elif stored.dtype.kind == "i":
        values = stored / float(-np.iinfo(stored.dtype).min)
    else:
        values = stored.astype(np.float64)
    return {"wav": values.reshape(len(values), -1)}, float(rate)


def read_uff_times(path: Path) -> tuple[dict[str, Any], float]:
    """Time records by ``node:direction`` (the n-th of one name gets ``#n``), and their common rate, Hz.

    Raises
    ------
    FileFormatError
        No time record, unequal rates, or a damaged file.
    """
    records = [entry for entry in read_uff_sets(path, (58,)) if entry.get("func_type") == _TIME_RESPONSE]
    if not records:
        raise FileFormatError(
            f"{path} holds no time record (data set 58, function 1); FRFs are converted without a mapping file"
        )
    steps = {round(float(entry["abscissa_inc"]), 15) for entry in records}
    if len(steps) != 1 or not min(steps) > 0:
        raise FileFormatError(f"{path} holds time records of the steps {sorted(steps)} s; export one rate a file")
    fields: dict[str, Any] = {}
    for entry in records:
        node, direction = int(entry["rsp_node"]), int(entry["rsp_dir"])
        axis = _TRANSLATIONS.get(abs(direction), "+S")
        name = f"{node}:{axis if direction >= 0 else axis.replace('+', '-')}"
        same = sum(key.split("#")[0] == name for key in fields)
        fields[f"{name}#{same + 1}" if same else name] = np.real(np.asarray(entry["data"])).astype(float)
    return fields, 1.0 / min(steps)
