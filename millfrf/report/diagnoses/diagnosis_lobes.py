"""Effect of a diagnosis on the stability lobes."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.figures import lobes_figure
from millfrf.mismatch import Hypothesis, StructureDiagnosis, equivalent_receptance
from millfrf.stability import StabilityLobes, zero_order
from modal_fit import ModalModel

from ...tables import Table
from ..section import Section, picture_of
from .diagnosis_answers import offered_in_words

ASSUMED = MillingProcess(
    teeth=2,
    diameter=0.010,
    edge_angle=np.pi / 2,
    ktc=800e6,
    krc=0.3,
    kac=0.2,
    start_angle=0.0,
    exit_angle=np.pi,
    feed_per_tooth=1e-4,
)
"""A slot in aluminium, where no cut is named."""

SPEEDS, DEEPEST = 240, 0.2

LINES_PER_WIDTH = 24
"""Frequencies within a resonance's half-power width: depths are then within 0.2 % of those of a finer grid."""

FEWEST_LINES, MOST_LINES = 600, 4000


def diagnosis_lobes_section(diagnosis: StructureDiagnosis, process: MillingProcess | None) -> Section:
    """Compare depth limits of the nominal and the improved structure, the latter at the weakest and strongest level.

    Parameters
    ----------
    diagnosis
        Diagnosis in which something was found.
    process
        Milling process of the cut; None: a slot that is assumed.

    Raises
    ------
    InputError
        A model without the axes that a cut needs.
    """
    title = "What it does to the lobes"
    if diagnosis.verdict != "explained":
        return Section(title)
    unit = diagnosis.details.final.hypothesis.model.unit
    if unit != "m/N":
        said = f"Lobes need a model in m/N; this one is in {unit}."
        return Section(title, (said,) if process is not None else ())
    cut = process or ASSUMED
    curves = _curves(diagnosis, cut)
    names = list(curves)
    lowest = {name: float(np.nanmin(lobes.depth_limits)) for name, lobes in curves.items()}
    rows = tuple((name, f"{1e3 * depth:.3g}", f"{depth / lowest[names[0]]:.2f}") for name, depth in lowest.items())
    told = "the cut given" if process else "a slot, 2 teeth, K_tc 800 MPa, as no cut was given (--cutting CUT.toml)"
    sentence = (
        f"For {told}: zero-order limits, which compare structures and cannot see period doubling: cut by those of "
        "`millfrf lobes` with the improved model. Joints count as the spring and damper that come closest to their law "
        "at the motion of the recording named; faults of the measuring chain are no part of the structure."
    )
    columns = ("structure", "depth stable at every speed (mm)", "over nominal")
    table = Table("Depth that is stable at every speed drawn", columns, rows)
    caption = "(a) Largest stable axial depth over spindle speed; (b) chatter frequency at the limit."
    picture = picture_of(lobes_figure(curves), caption, "Stability lobes before and after")
    return Section(title, (sentence, *offered_in_words(diagnosis)), (table,), (picture,))


def _frequencies(model: ModalModel) -> NDArray[np.float64]:
    """Frequencies from a third of the lowest mode to three times the highest, as dense as the sharpest one needs."""
    natural, sharpest = model.natural_frequencies, max(float(model.damping_ratios.min()), 1e-6)
    span = np.log(9 * natural.max() / natural.min())
    lines = int(np.clip(LINES_PER_WIDTH * span / (2 * sharpest), FEWEST_LINES, MOST_LINES))
    return np.geomspace(natural.min() / 3, 3 * natural.max(), lines)


def _curves(diagnosis: StructureDiagnosis, cut: MillingProcess) -> dict[str, StabilityLobes]:
    final, lines = diagnosis.details.final.hypothesis, diagnosis.details.recordings
    nominal = final.nominal
    natural = nominal.model.natural_frequencies
    frequencies = _frequencies(nominal.model)
    tooth = 2 * np.pi / cut.teeth
    speeds = np.geomspace(natural.min() * tooth / 2, 3 * natural.max() * tooth, SPEEDS)

    def limits(hypothesis: Hypothesis, place: int) -> StabilityLobes:
        return zero_order(equivalent_receptance(hypothesis, lines[place], frequencies), cut, speeds, DEEPEST)

    curves = {"nominal": limits(nominal, 0)}
    if any(cause.axis is not None for cause in final.causes) and len(lines) > 1:
        for place in (0, len(lines) - 1):
            curves[f"improved, as in {lines[place].recording.name}"] = limits(final, place)
    else:
        curves["improved"] = limits(final, 0)
    if any(not np.isfinite(lobes.depth_limits).any() for lobes in curves.values()):
        raise InputError(f"no limit below {1e3 * DEEPEST:g} mm; the structure is too stiff for the cut")
    return curves
