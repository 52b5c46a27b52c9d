"""Step ``tool``: FRF at the tip of another tool, from taps on blanks in the same spindle or robot."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from estimation import Frf, read_frf, write_frf
from millfrf.core import InputError, Result, Summary, doubts_line
from millfrf.core.progress import progress
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import Table, say, say_written, show, tell, warn
from millfrf.gate import check_frf, check_tool, stored_warnings
from modal_fit import (
    Base,
    PredictedTip,
    Tool,
    first_clamped_frequency,
    identify_base,
    predict_tip,
    read_tool,
    taps_of_blanks,
)

from .answers import frf_answer, size_of
from .given import Picture
from .settings import STEPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@step
def tool(
    *blanks: Annotated[File, Reads("BLANK.toml")],
    new: Annotated[File, Reads("TOOL.toml")],
    out: Annotated[File | None, Writes(suffixes=(".h5", ".hdf5"), needed=True)] = None,
    picture: Picture = None,
) -> "ToolTip":
    """FRF at the tip of another tool in the same spindle or robot, predicted from taps on one or two blanks.

    Taps on blanks, simple cylinders in the same holder, show the receptance of the base, with rotation; the new tool
    is a beam on it (receptance coupling). One blank needs two points, both hit and measured.

    Parameters
    ----------
    blanks
        Tool files of the blanks, each with the name of its FRF file.
    new
        Tool file of the tool that was not measured.
    out
        FRF file to write, with the errors of the prediction.
    picture
        Picture of the blanks' measured FRFs and of the prediction with its band to write.

    Returns
    -------
    ToolTip
        The predicted FRF, the base, and the warnings.

    Raises
    ------
    InputError
        Files that cannot be used, taps that do not determine the base, or an error that exceeds the receptance.

    Examples
    --------
    ::

        $ millfrf tool long.toml short.toml --new endmill.toml --out tip.h5
    """
    if not blanks:
        raise InputError("no blank given; name the tool file of one at least")
    tools, wanted = [read_tool(path) for path in blanks], read_tool(new)
    warnings = [warning for described in (*tools, wanted) for warning in check_tool(described)]
    paths = [_frf_path(path, blank) for path, blank in zip(blanks, tools, strict=True)]
    frfs = [read_frf(path) for path in paths]
    for frf, path in zip(frfs, paths, strict=True):
        warnings += [*stored_warnings(path), *check_frf(frf, path.name)]
    collected = taps_of_blanks(tools, frfs)
    with progress("base from the taps"):
        base = identify_base(collected.taps)
        tip = predict_tip(base, wanted, collected.frequencies, collected.time_constant)
    warnings += [*collected.left_out, *check_frf(tip.frf, "the prediction"), *_doubts(base, tip, wanted)]
    result = ToolTip(tip, base, tuple(dict.fromkeys(warnings)))
    if out is not None:
        stated = origin("tool", [*blanks, *paths, new]) | {
            "warnings": list(result.warnings),
            "error_shares": tip.shares,
        }
        write_frf(out, tip.frf, title=f"predicted tip of {Path(new).name}", provenance=json.dumps(stated))
    if picture is not None:
        from millfrf.figures import save_figure, tool_tip_figure

        save_figure(tool_tip_figure({path.stem: frf for path, frf in zip(paths, frfs, strict=True)}, tip), picture)
    tell(lambda: {**frf_answer(tip.frf), "error_shares": tip.shares, **_contact_answer(base)})
    warn(result.warnings)
    show(_error_table(tip))
    for line in _contact_lines(base):
        say(line)
    say_written([file for file in (out, picture) if file is not None], size_of(tip.frf))
    return result


@dataclass(frozen=True, eq=False, repr=False)
class ToolTip(Result):
    """Predicted FRF at the tip of a tool that was not measured.

    Parameters
    ----------
    tip
        The FRF, with its errors by source.
    base
        Base that the taps show, with the contact where it was looked for.
    warnings
        Warnings, one sentence each.
    """

    tip: PredictedTip
    base: Base
    warnings: tuple[str, ...]

    @property
    def frf(self) -> Frf:
        """The predicted receptance at the tip."""
        return self.tip.frf

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see ``draw_frf`` for the choices."""
        return self.frf.plot(axes, **choices)

    def _summary(self) -> Summary:
        table = _error_table(self.tip)
        return Summary(
            f"ToolTip: receptance of {len(self.frf.responses)} directions",
            (size_of(self.frf), *_contact_lines(self.base), *doubts_line(self.warnings)),
            table.columns,
            table.rows,
        )


def _frf_path(path: str | os.PathLike[str], blank: Tool) -> Path:
    """Return the path of a blank's FRF, whose name counts from the folder of its tool file."""
    if not blank.table.frf:
        raise InputError(f'{blank.name} names no FRF: add frf = "FILE.h5" with the FRF of taps on this blank')
    return Path(path).parent / blank.table.frf


def _doubts(base: Base, tip: PredictedTip, new: Tool) -> list[str]:
    """Warn of taps that disagree or have nothing to spare, and of modes of the tool above the band."""
    warnings = list(base.doubts())
    assert tip.frf.band is not None
    top = tip.frf.band[1]
    clamped = first_clamped_frequency(new, STEPS.clamped_reach * top)
    if top < clamped < np.inf:
        warnings.append(
            f"clamped rigidly, {new.name} alone has its first mode at {clamped:.4g} Hz, above the band of the taps (to "
            f"{top:.4g} Hz): the FRF holds no mode of the tool itself"
        )
    return warnings


def _error_table(tip: PredictedTip) -> Table:
    rows = tuple((name, f"{100 * share:.2g}") for name, share in tip.shares.items())
    return Table("Errors of the prediction", ("source", "% of the receptance (rms)"), rows)


def _contact_lines(base: Base) -> list[str]:
    """Describe the contact: stiffness and loss factor in deflection and rotation with standard errors."""
    if not base.has_contact:
        return []
    compliances, errors = base.compliances()
    lines = []
    for name, unit, compliance, error in zip(
        ("deflection", "rotation"), ("N/m", "N m/rad"), compliances, errors, strict=True
    ):
        if compliance.real <= 2 * error:
            least = 1 / max(compliance.real + 2 * error, 1e-300)
            lines.append(f"contact in {name}: rigid within its error, stiffer than {least:.3g} {unit}")
        else:
            stiffness = 1 / compliance
            lines.append(
                f"contact in {name}: {stiffness.real:.3g} {unit} +- {100 * error / compliance.real:.2g} %, "
                f"loss factor {stiffness.imag / stiffness.real:.2g}"
            )
    return lines


def _contact_answer(base: Base) -> dict[str, Sequence[float]]:
    if not base.has_contact:
        return {}
    compliances, errors = base.compliances()
    return {
        "contact_compliance": compliances.real.tolist(),
        "contact_compliance_lost": (-compliances.imag).tolist(),
        "contact_compliance_std": errors.tolist(),
    }
