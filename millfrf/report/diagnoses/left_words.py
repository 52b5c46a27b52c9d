"""Why a partial answer is not whole, in words."""

from millfrf.mismatch import StructureDiagnosis


def left_in_words(diagnosis: StructureDiagnosis) -> str:
    """Why a partial answer is not whole: what the named laws leave of the held-out recording.

    Where the improved model holds a free form, its error is not that of the named laws; both are said.

    Parameters
    ----------
    diagnosis
        A diagnosis that is partly explained.
    """
    free = diagnosis.content.get("free_form")
    if free:
        compared, freed = (100 * free["held_out"][key] for key in ("compared", "free_form"))
        return (
            f"the named law leaves {compared:.3g} % of the held-out response, more than a whole explanation may "
            f"leave; a free form of it leaves {freed:.3g} %"
        )
    return (
        f"{100 * diagnosis.improvement.after:.3g} % of the held-out response is still not predicted, and "
        f"{100 * diagnosis.leftover:.0f} % of that moves with the signal, more than a whole explanation may leave"
    )
