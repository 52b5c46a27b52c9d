from .distance_from_law import FormOfLaw, form_of_law
from .freed_in_answer import FreedAnswer, freed_answer
from .freed_laws_proved import Beginning, FreedLaws, freed_from_named, freed_from_nothing

__all__ = [
    "Beginning",
    "FormOfLaw",
    "FreedAnswer",
    "FreedLaws",
    "form_of_law",
    "freed_answer",
    "freed_from_named",
    "freed_from_nothing",
]
