"""Families of lines sorted into foreign tones and those that may be chatter."""

from dataclasses import dataclass, replace

from .motion import TOLERANCE, Evidence, Family, Line
from .verdict import ForeignTone

MAINS = (50.0, 60.0)
"""Frequencies of the power supply, Hz."""
_MAINS_ERROR = 0.004  # relative, beside the resolution of the spectrum
_MAINS_HARMONICS = 20
_WIDEST = 0.5  # Hz; a line that is known less well is not named by its frequency
UNMODULATED = "tone without side lines at the tooth passing"
"""Name of a tone that is known by nothing else."""
SMALL = 0.03
"""Share of the motion below which lines do not matter: no limit cycle is as small."""
TOO_LARGE = 0.3
"""Share of the motion from which a line without side lines is not called foreign."""
_SIDE = 0.02  # least size of a side line over the strongest
_CHANCE = 0.15  # share of the motion below which one side line may be there by chance


@dataclass(frozen=True)
class Sorted:
    """The lines of a recording, sorted by their origin.

    Parameters
    ----------
    suspects
        Families that may be chatter, largest first, with the lines that count.
    foreign
        Tones that are not.
    """

    suspects: tuple[Family, ...]
    foreign: tuple[ForeignTone, ...]


def sort_families(evidence: Evidence) -> Sorted:
    """Sort the families of lines that matter.

    Chatter is modulated by the periodic cut and has side lines at the tooth passing; hum and other machines' tones have
    none, and lines of the power supply are known by their frequency as well.
    """
    suspects: list[Family] = []
    foreign: list[ForeignTone] = []
    for family in evidence.families:
        if family.share < SMALL:
            continue
        counted = _counted(family, evidence)
        name = _foreign_name(counted, evidence)
        if name:
            foreign.append(ForeignTone(family.lines[0].frequency, family.share, name))
        else:
            suspects.append(counted)
    return Sorted(tuple(suspects), tuple(foreign))


def _counted(family: Family, evidence: Evidence) -> Family:
    """The family without lines that are too small or that are the supply's beside another of the supply."""
    strongest = family.lines[0]
    size = float((strongest.amplitude**2).sum())
    hum = bool(mains_of(strongest, evidence))
    lines = [strongest]
    for line in family.lines[1:]:
        if (line.amplitude**2).sum() > _SIDE**2 * size and not (hum and mains_of(line, evidence)):
            lines.append(line)
    return replace(family, lines=tuple(lines))


def mains_of(line: Line, evidence: Evidence) -> str:
    """Name a line of the mains as :func:`mains_name` does, to the accuracy of a line's frequency in the recording."""
    track = evidence.track
    return mains_name(line.frequency, width_of(line, evidence.spectrum.resolution, track.mean_frequency, track.drift))


def _foreign_name(family: Family, evidence: Evidence) -> str:
    """Name of a tone that is foreign; empty where it may be chatter."""
    strongest, track = family.lines[0], evidence.track
    width = width_of(strongest, evidence.spectrum.resolution, track.mean_frequency, track.drift)
    if family.share < _CHANCE and is_alias(strongest, evidence.sample_rate, track.mean_frequency, width):
        return "order of the spindle, folded by sampling"
    mains = mains_name(strongest.frequency, width)
    alone = len(family.lines) == 1
    if mains and (alone or (len(family.lines) == 2 and family.share < _CHANCE)):
        return mains
    if alone and family.share < TOO_LARGE:
        return UNMODULATED
    return ""


def mains_name(frequency: float, width: float) -> str:
    """``mains (3 x 50 Hz)`` where a frequency (Hz, known within ``width``) is one of the supply's; else empty."""
    for mains in MAINS:
        number = round(frequency / mains)
        if (
            1 <= number <= _MAINS_HARMONICS
            and abs(frequency - number * mains) < min(width, _WIDEST) + _MAINS_ERROR * mains
        ):
            return f"mains ({number} x {mains:g} Hz)"
    return ""


def is_alias(line: Line, sample_rate: float, spindle: float, width: float) -> bool:
    """Whether a line lies where sampling folds high orders of the spindle, in the upper part of the spectrum."""
    if line.frequency < 0.2 * sample_rate:
        return False
    away = (sample_rate - line.frequency) / spindle
    return abs(away - round(away)) * spindle < width


def width_of(line: Line, resolution: float, spindle: float, drift: float) -> float:
    """How well a line's frequency is known, Hz: the spectrum's resolution, and drift that widens it."""
    return TOLERANCE * resolution * spindle + 0.5 * abs(drift) * line.frequency
