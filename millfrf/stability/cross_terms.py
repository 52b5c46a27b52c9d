"""What cross terms that were not measured may change in depth limits."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .settings import SETTINGS
from .solvers.multi_frequency import compared_speeds, multi_frequency
from .tip_receptance import ToolReceptance, tool_receptance
from .unmeasured import missing_cross_terms


@dataclass(frozen=True)
class CrossTermEffect:
    """Change of limits by cross terms of a share of the direct terms, ``H_xy = H_yx = +-share sqrt(H_xx H_yy)``."""

    share: float
    lowered: float  # largest decrease of a limit, as a share of it
    raised: float  # largest increase
    speed: float  # rad/s, of the largest decrease


def cross_term_effect(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> CrossTermEffect | None:
    """Compute limits with cross terms of both signs, and compare them with those without.

    The transverse sensitivity of accelerometers and a hit a few degrees off make cross terms of some per cent of the
    direct ones. A mode at an angle to X and Y moves both, with cross terms as large as the direct ones and of another
    sign than those of the next mode: that is no bound for it. All limits are those of the multi-frequency solution, so
    that only the cross terms differ.

    Parameters
    ----------
    structure
        Receptance at the tip whose direct terms were measured; it states what was not (``measured``).
    process
        Cutter and engagement; edges count as straight, which changes all three limits alike.
    spindle_speeds : (n_speeds,), rad/s
        Speeds of the limits; up to eight of them are compared, those with too many harmonics are left out.
    max_depth : m
        Largest axial depth that is searched; a limit that only one of two cases has counts as this depth in the other.

    Returns
    -------
    CrossTermEffect or None
        None where all cross terms between the tool's directions were measured, or where no speed can be compared.
    """
    missing = missing_cross_terms(structure)
    speeds = compared_speeds(structure, process, spindle_speeds) if missing.any() else np.zeros(0)
    if not len(speeds):
        return None
    straight = replace(process, helix_angle=0.0)
    direct = replace(tool_receptance(structure), open_above=False)  # all cases with the same highest frequency

    def limits(share: float) -> Real:
        case = _with_cross_terms(direct, missing, share)
        return np.minimum(multi_frequency(case, straight, speeds, max_depth).depth_limits, max_depth)

    share = SETTINGS.cross_terms
    change = np.array([limits(share), limits(-share)]) / limits(0.0) - 1
    lowest = change.min(axis=0)
    lowered, raised = float(max(-lowest.min(), 0.0)), float(max(change.max(), 0.0))
    return CrossTermEffect(share, lowered, raised, float(speeds[lowest.argmin()]))


def _with_cross_terms(direct: ToolReceptance, missing: NDArray[np.bool_], share: float) -> ToolReceptance:
    def evaluate(frequencies: Real) -> Complex:
        values = direct.evaluate(frequencies)
        diagonal = np.einsum("kii->ki", values)
        # a drive point has phases from 0 to -180 degrees: the root must not jump where noise passes -180
        angle = np.mod(np.angle(diagonal) - np.pi / 2, 2 * np.pi) - 1.5 * np.pi
        root = np.sqrt(np.abs(diagonal)) * np.exp(0.5j * angle)
        return np.asarray(values + share * missing * root[:, :, None] * root[:, None, :])

    return replace(direct, evaluate=evaluate)
