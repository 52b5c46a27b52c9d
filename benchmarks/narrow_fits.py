"""Limits of fits to narrow bands, with the fit's own poles outside the band and with one flexibility in their place.

Run it: ``python -m benchmarks.narrow_fits``. The simulated robot of Table 1 (Mohammadi & Ahmadi), which has no mode
outside, is milled in three sweeps; H1 of 16 s segments is fitted in several bands. It prints the largest error of the
certified limits at 34 speeds from 600 to 2400 rpm against those of the truth.
"""

import importlib.util
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording
from estimation import Frf, cross_spectra, h1, settings_for, sum_tests
from millfrf.stability import certified_lobes
from modal_fit import ModalModel, fit_polyreference
from replay_data import table_one_model

BANDS = ((13.0, 25.0), (15.2, 22.5), (15.2, 45.0), (15.2, 69.0))
DEEPEST = 0.01


def example() -> Any:
    """Load the example that mills the sweeps and states the cut."""
    path = Path(__file__).resolve().parents[1] / "examples" / "from_recordings_to_lobes.py"
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def measured(script: Any) -> Frf:
    """Mill three sweeps and estimate their FRF by H1."""
    tests = []
    with tempfile.TemporaryDirectory() as folder:
        for path in script.mill(Path(folder), 60.0):
            with Recording(path) as recording:
                settings = settings_for(recording.stream().sample_rate, script.SEGMENT)
                tests.append(cross_spectra(recording, settings))
    return h1(sum_tests(tests))


def as_modes(model: ModalModel) -> ModalModel:
    """Take the poles that the fit put outside its band for modes of the structure."""
    outside = model.residuals
    if outside is None or outside.poles is None or outside.residues is None:
        return model
    u, size, v = np.linalg.svd(outside.residues, full_matrices=False)
    right = (u * size[:, None, :]).swapaxes(1, 2).reshape(-1, len(model.responses))
    return replace(
        model,
        poles=np.concatenate([model.poles, np.repeat(outside.poles, size.shape[1])]),
        right=np.concatenate([model.right, right]),
        left=np.concatenate([model.left, v.reshape(-1, len(model.excitations))]),
        residuals=replace(outside, poles=None, residues=None),
        covariance=None,
        errors=None,
    )


def worst(limits: NDArray[np.float64], truth: NDArray[np.float64]) -> str:
    """Write the largest relative error, or that the model sees no limit."""
    if np.isinf(limits[np.isfinite(truth)]).any():
        return "no limit"
    error = 100 * (limits / truth - 1)
    return f"{error[np.argmax(np.abs(error))]:+.1f} %"


def main() -> None:
    """Fit each band and print its row."""
    script = example()
    frf = measured(script)
    speeds = np.linspace(600, 2400, 34) * script.RPM
    truth = certified_lobes(table_one_model(), script.CUTTER, speeds, DEEPEST).depth_limits
    print("| fitted band, Hz | modes | with the fit's own poles | with one flexibility |\n|---|---|---|---|")
    for band in BANDS:
        model = fit_polyreference(frf, band).model
        own, flexible = (
            certified_lobes(each, script.CUTTER, speeds, DEEPEST).depth_limits for each in (as_modes(model), model)
        )
        print(f"| {band[0]:g} to {band[1]:g} | {len(model.poles)} | {worst(own, truth)} | {worst(flexible, truth)} |")


if __name__ == "__main__":
    main()
