"""What distinguishes a cut, in words; and the refusal of cuts that a calculation does not take."""

import math
from collections.abc import Collection

from millfrf.core import InputError, with_error

from .process import MillingProcess

ANY_MILL = ("runout", "shape", "helix", "pitch", "damping")  # what may differ between milling cuts


def refuse_varied(process: MillingProcess, what: str, remedy: str, *, takes: Collection[str] = ()) -> None:
    """Refuse a shape of the cutter, unequal pitch or process damping that a calculation does not support.

    Parameters
    ----------
    process
        Milling process to check.
    what
        Name of the calculation; it is the subject of the message.
    remedy
        What the user can do instead; it ends the message.
    takes
        Properties that the calculation supports, among ``turning``, ``runout``, ``shape``, ``helix``, ``pitch`` and
        ``damping``.

    Raises
    ------
    InputError
        The process has a property that is not supported; the message names the first.
    """
    present = {
        "turning": (process.is_turning, "turning, where the edge keeps its direction"),
        "runout": (process.runout_decides, "runout that takes a tooth out of most of its cut"),
        "shape": (
            bool(process.profile or process.serration_amplitude or len(set(process.helices)) > 1),
            f"a cutter with {shape_in_words(process)}",
        ),
        "helix": (max(process.helices) != 0, "helical edges"),
        "pitch": (not process.equal_pitch, "unequal pitch"),
        "damping": (process.process_damping != 0, "process damping"),
    }
    for name, (is_present, words) in present.items():
        if is_present and name not in takes:
            raise InputError(f"{what} does not take {words}; {remedy}")


def coefficients_in_words(process: MillingProcess) -> str:
    """List the cutting coefficients of a process, with two standard errors where these are known.

    Examples
    --------
    >>> coefficients_in_words(
    ...     MillingProcess(2, 0.01, math.pi / 2, 781e6, 0.3, 0.0, 0.0, math.pi, 1e-4, ktc_std=2.15e6, krc_std=0.0058)
    ... )
    'ktc 781.0 ± 4.3 MPa, krc 0.300 ± 0.012, kac 0'
    """
    errors = (1e-6 * process.ktc_std, process.krc_std, process.kac_std)
    ktc, krc, kac = map(_with_two_errors, (1e-6 * process.ktc, process.krc, process.kac), errors)
    return f"ktc {ktc} MPa, krc {krc}, kac {kac}"


def edges_in_words(process: MillingProcess) -> str:
    """List the edge coefficients of a process as :func:`coefficients_in_words`; empty without edge forces."""
    values = (process.kte, process.kre, process.kae)
    if not any(values):
        return ""
    errors = [math.sqrt(row[k]) for k, row in enumerate(process.covariance)][3:6] or [0.0] * 3
    shown = [_with_two_errors(1e-3 * value, 1e-3 * error) for value, error in zip(values, errors, strict=True)]
    return f"kte {shown[0]}, kre {shown[1]}, kae {shown[2]} N/mm"


def _with_two_errors(value: float, error: float) -> str:
    return with_error(value, 2 * error) if error > 0 else f"{value:.4g}"


def law_in_words(process: MillingProcess) -> str:
    """Say at which chip thickness the coefficients of a process hold and how they fall; empty: they are constant.

    Examples
    --------
    >>> from millfrf.cutting import ChipLaw
    >>> law = ChipLaw((0.25, 0.25, 0.25), edge_radius=1e-5)
    >>> law_in_words(MillingProcess(2, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4, chip_law=law))
    ' at a chip of 1 mm, with exponents 0.25, 0.25, 0.25 down to the edge radius of 0.01 mm'
    """
    law = process.chip_law
    if not law.varies:
        return ""
    exponents = ", ".join(f"{exponent:.3g}" for exponent in law.exponents)
    return (
        f" at a chip of {1e3 * law.reference:.3g} mm, with exponents {exponents} down to the edge radius of "
        f"{1e3 * law.edge_radius:.3g} mm"
    )


def shape_in_words(process: MillingProcess) -> str:
    """Name what distinguishes the edges of a process from a cylinder with equal teeth; empty: nothing.

    Examples
    --------
    >>> shape_in_words(MillingProcess(2, 0.01, math.pi / 2, 1e8, 0.3, 0.0, 0.0, math.pi, 1e-4))
    ''
    """
    arcs = [element for element in process.profile if element.curvature > 0]
    if process.is_turning:
        return f"a nose radius of {1e3 / arcs[0].curvature:g} mm" if arcs else ""
    words = []
    if arcs:
        corner = 1 / arcs[0].curvature
        ball = arcs[0].radius < 1e-9 and abs(corner - process.diameter / 2) < 1e-9
        words.append("a ball end" if ball else f"a corner radius of {1e3 * corner:g} mm")
    elif process.profile:
        words.append(f"edges at {math.degrees(process.profile[0].edge_angle):g} deg to the plane of rotation")
    if len(set(process.helices)) > 1:
        words.append("helix angles of " + ", ".join(f"{math.degrees(angle):g}" for angle in process.helices) + " deg")
    if process.serration_amplitude:
        words.append("serrated edges")
    if process.runout_decides:
        words.append(f"runout that takes a tooth out of {100 * max(process.missed_shares):.0f} % of its cut")
    return ", ".join(words)
