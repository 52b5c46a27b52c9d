"""What modes do with the level, whatever law stands behind it: sentences and a figure."""

from millfrf.figures import behaviour_figure
from millfrf.mismatch import StructureDiagnosis

from ..section import Section, picture_of

TITLE = "What the modes do with the level"


def behaviour_section(diagnosis: StructureDiagnosis) -> Section:
    """Each mode by level in words, and frequencies and damping ratios drawn over the level."""
    found = diagnosis.details.behaviour
    if found is None:
        return Section(TITLE, ())
    sentences = [found.sentence]
    sentences += [f"{one.sentence[:1].upper()}{one.sentence[1:]}." for one in found.modes]
    sentences += [f"{one[:1].upper()}{one[1:]}." for one in found.distortion]
    told = tuple(dict.fromkeys(sentences))
    if not found.modes or len(found.modes[0].levels) < 2:
        return Section(TITLE, told)
    caption = (
        "Each recording refitted alone by a linear model, no law assumed. Bars are two standard errors and count what "
        "a linear model cannot follow. (a) Natural frequency from that at the lowest level; (b) damping ratio."
    )
    picture = picture_of(behaviour_figure(found), caption, "Natural frequency and damping by level")
    return Section(TITLE, told, (), (picture,))
