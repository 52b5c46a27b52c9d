"""Refusal of processes that a calculation does not cover, in words that say what does."""

from collections.abc import Collection

from foundation import InputError

from .milling_process import MillingProcess


def refuse_varied(process: MillingProcess, what: str, remedy: str, *, takes: Collection[str] = ()) -> None:
    """Refuse a helix, an unequal pitch or process damping unless ``what`` takes it.

    Parameters
    ----------
    process
        Milling process to check.
    what
        Name of the calculation; it is the subject of the message.
    remedy
        What to do instead.
    takes
        Those of ``helix``, ``pitch`` and ``damping`` that the calculation covers.

    Raises
    ------
    InputError
        With the first that is not covered.
    """
    present = {
        "helix": (process.helix_angle != 0, "helical edges"),
        "pitch": (not process.equal_pitch, "unequal pitch"),
        "damping": (process.process_damping != 0, "process damping"),
    }
    for name, (given, words) in present.items():
        if given and name not in takes:
            raise InputError(f"{what} does not take {words}; {remedy}")
