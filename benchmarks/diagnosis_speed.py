"""What a diagnosis costs beside its floor: `python -m benchmarks.diagnosis_speed`.

One concealed case of the blind trial (a hardening joint, three recordings) is simulated and read. The floor of one
prediction is its FFTs: the predicted responses go back to time over the padded record, and their window into lines
again. Every time is that of the processor, the smallest of five, and stands as a multiple of that floor in the same
run: one prediction, one set of derivatives of modal parameters alone and beside a joint's law that is simulated
freely, and the whole diagnosis. BLAS threads are pinned to one.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.fft import irfft, rfft

from estimation import WindowedSpectrum
from millfrf.mismatch import StructureDiagnosis, diagnose, predict_lines, read_recordings
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.misfit import jacobian
from modal_fit import ModalModel, read_modal_model

from .blind_trial.case_spec import draw_cases
from .blind_trial.sealed_case import write_case

REPEATS = 5
SEED = 1


def least(work: Callable[[], object]) -> float:
    """Least processor time of some work, s; that of its copies counts."""
    work()
    times = []
    for _ in range(REPEATS):
        began = spent()
        work()
        times.append(spent() - began)
    return min(times)


def spent() -> float:
    """Processor time of this process and of its copies that have ended, s."""
    copies = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + copies.ru_utime + copies.ru_stime


def floor(lines: list[WindowedSpectrum]) -> None:
    """The FFTs that one prediction of all recordings cannot do without."""
    for recording in lines:
        spectrum = np.zeros((recording.padded // 2 + 1, recording.measured.shape[1]), dtype=complex)
        signal = irfft(spectrum, n=recording.padded, axis=0)
        rfft(signal[: len(recording.window)], axis=0)


def case(folder: Path) -> tuple[ModalModel, list[Path]]:
    """A model and three recordings of a structure whose joint hardens."""
    spec = replace(draw_cases(1, SEED, only="stiffness_hardening")[0], strength=20.0, noise=0.02)
    written = write_case(spec, folder)
    return read_modal_model(written / "nominal.json"), [written / f"{level}.h5" for level in ("low", "mid", "high")]


def answered(model: ModalModel, files: list[Path]) -> tuple[StructureDiagnosis, float]:
    """The diagnosis, and the processor time that it takes when everything is loaded, s."""
    recordings = read_recordings(files, model)
    diagnosis = diagnose(model, recordings)
    began = spent()
    diagnose(model, recordings)
    return diagnosis, spent() - began


def main() -> None:
    """Print each cost as a multiple of the floor."""
    with tempfile.TemporaryDirectory() as folder:
        model, files = case(Path(folder))
        diagnosis, whole = answered(model, files)
    lines, base, final = list(diagnosis.details.measured), diagnosis.details.base, diagnosis.details.final
    unit = least(lambda: floor(lines))

    def predicted(fitted: Fit) -> Callable[[], object]:
        return lambda: [predict_lines(fitted.hypothesis, recording) for recording in lines]

    def derived(fitted: Fit) -> Callable[[], object]:
        here = fitted.hypothesis
        return lambda: [jacobian(here, recording, predict_lines(here, recording)) for recording in lines]

    costs = {
        "one prediction, modal parameters alone": least(predicted(base)),
        "one prediction with the causes found": least(predicted(final)),
        f"prediction and derivatives, {base.hypothesis.size} numbers": least(derived(base)),
        f"prediction and derivatives, {final.hypothesis.size} numbers with the causes": least(derived(final)),
        "whole diagnosis": whole,
    }
    samples = ", ".join(str(len(recording.recording.force)) for recording in lines)
    named = ", ".join(cause.name for cause in diagnosis.physics)
    print(f"verdict {diagnosis.verdict}: {named}; recordings of {samples} samples")
    print(f"{'FFTs of one prediction (the floor)':<62}{unit:9.4f} s       1 floor")
    for name, seconds in costs.items():
        print(f"{name:<62}{seconds:9.4f} s {seconds / unit:7.0f} floors")


if __name__ == "__main__":
    main()
