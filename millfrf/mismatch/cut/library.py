"""Library of causes of a wrong cutting force."""

from .physics import PROCESS_DAMPING, REGENERATIVE_FEEDBACK, RUNOUT, CutPhysics

CAUSES: tuple[CutPhysics, ...] = (PROCESS_DAMPING, REGENERATIVE_FEEDBACK, RUNOUT)
"""All causes of the library; a new one is added here."""


def cut_library() -> dict[str, CutPhysics]:
    """All causes by name.

    Examples
    --------
    >>> sorted(cut_library())
    ['process_damping', 'regenerative_feedback', 'runout']
    """
    return {cause.name: cause for cause in CAUSES}
