"""Modal scales by reciprocity: how a force inside the structure pushes a mode, from how the mode moves there."""

import numpy as np

from modal_fit import ModalModel

from .joint_axis import Complex, JointAxis, ModalScales, tip_axes


def modal_scales(model: ModalModel) -> ModalScales:
    """Scales in which a mode's part in a joint is one real number.

    A reciprocal structure with real mode shapes ``phi`` has residues ``phi_p phi_q / (2 i omega m)``: along each mode,
    motion and push at a point are one real number, times a right and a left scale whose product lags by a quarter of a
    turn where the structure is passive. Their sizes are those of the mode's vectors over the common axes, so that a
    part of one is that of a joint at the tip which moves as the tip does; their phases are fitted to both vectors.

    Parameters
    ----------
    model
        Modal model whose common axes (:func:`tip_axes`) show right against left vectors.
    """
    rows, columns, _ = tip_axes(model)
    right, left = model.right @ rows, model.left @ columns
    seen, pushed = np.linalg.norm(right, axis=1), np.linalg.norm(left, axis=1)
    turn = _doubled_phase(right) - np.conj(_doubled_phase(left))
    phase = np.exp(0.5j * np.angle(turn))
    return ModalScales(seen * phase, -1j * pushed * np.conj(phase))


def inside_of(model: ModalModel, axis: JointAxis) -> JointAxis:
    """The axis over the modes, each with a phase, that moves and pushes most like one at the tip.

    Parameters
    ----------
    model
        Modal model whose modes take part.
    axis
        A direction at the tip.
    """
    scales = modal_scales(model)
    rows, columns, _ = tip_axes(model)
    seen, pushed = model.right @ rows @ axis.entries / scales.seen, model.left @ columns @ axis.entries / scales.pushed
    parts = 0.5 * (seen + pushed)
    size = float(np.linalg.norm(parts))
    entries = np.append(parts.real, parts.imag) / size
    return JointAxis(entries, ModalScales(size * scales.seen, size * scales.pushed).with_phases())


def _doubled_phase(vectors: Complex) -> Complex:
    """Unit numbers with twice the phase that vectors (n_modes, n) are closest to, (n_modes,)."""
    squares = np.sum(vectors**2, axis=1)
    return np.asarray(squares / np.maximum(np.abs(squares), 1e-300))
