"""`conversion_advice`: what to do with a file of another program where a file made here is due."""

import os
from pathlib import Path

_RECORDED = (".mat", ".csv", ".npz", ".npy", ".tdms", ".wav")
_EXCHANGED = (".uff", ".unv")


def conversion_advice(path: str | os.PathLike[str]) -> str:
    """The commands that turn a file of another program into one made here; empty where its suffix tells none.

    Examples
    --------
    >>> print(conversion_advice("cut.mat"))
    convert it: millfrf new mapping cut.mat --out map.toml, then millfrf convert cut.mat cut.h5 --map map.toml
    """
    file = Path(path)
    target = f"{file.stem}.h5"
    if file.suffix.lower() in _RECORDED:
        return (
            f"convert it: millfrf new mapping {file.name} --out map.toml, then "
            f"millfrf convert {file.name} {target} --map map.toml"
        )
    if file.suffix.lower() in _EXCHANGED:
        return f"convert it: millfrf convert {file.name} {target}"
    return ""
