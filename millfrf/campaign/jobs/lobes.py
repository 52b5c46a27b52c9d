"""The job `lobes`: depth limits over spindle speed of the model of a set."""

import warnings
from pathlib import Path

from millfrf.core import MillfrfWarning
from millfrf.stability import write_lobes

from ...face import lobes as lobes_of
from ...provenance import of_lobes
from .fit import MODEL
from .work import Work

LOBES = "lobes.csv"


def lobes(work: Work, folder: Path) -> list[str]:
    """Stability lobes of the model at the tool tip.

    Raises
    ------
    InputError
        There is no model, or the cut and the model do not fit together.
    """
    (cutting,) = work.files
    model = work.need(work.needs[0].kind).folder / MODEL
    low, high, count = work.settings["speeds_rpm"]
    speeds, depth, method = (low, high, count), work.settings["max_depth_m"], work.settings["method"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MillfrfWarning)
        found = lobes_of(model, cutting, speeds=speeds, max_depth=depth, method=method)
    asked = {"speeds_rpm": speeds, "max_depth_m": depth, "method": method}
    write_lobes(folder / LOBES, found, provenance=of_lobes([model, cutting], asked))
    return list(found.warnings)
