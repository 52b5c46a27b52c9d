"""Pictures for the page on diagnosis: a robot tapped at rest and milled, one effect concealed, found again.

    python examples/diagnosis_stories.py [FOLDER]

writes the diagnosis' files and three pictures into FOLDER (docs/pictures by default for the pictures).
"""

import sys
import tempfile
from pathlib import Path

from millfrf.demonstration.concealment import ConcealOptions, run_concealed
from millfrf.figures import law_figure, spectra_figure
from millfrf.mismatch import diagnose, free_form_laws, held_out_spectra, read_recordings
from modal_fit import read_modal_model

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"


def main(folder: Path, effect: str = "coulomb_friction", seed: int = 4) -> dict[str, object]:
    """Conceal one effect, diagnose, draw; return what the diagnosis said."""
    with tempfile.TemporaryDirectory() as scratch:
        result = run_concealed(ConcealOptions(Path(scratch), seed=seed, effect=effect), say=print)
        print(result.hidden, result.diagnosis["verdict"], result.diagnosis["physics"], sep="\n")
        recordings = Path(scratch) / "recordings"
        model = read_modal_model(Path(scratch) / "nominal.json")
        trials = read_recordings([recordings / f"{level}.h5" for level in ("low", "mid", "high")], model)
        diagnosis = diagnose(model, trials)
    law_figure(free_form_laws(diagnosis)[0]).savefig(folder / "idle_against_milling_law.png", dpi=150)
    spectra_figure(held_out_spectra(diagnosis)).savefig(folder / "idle_against_milling_spectra.png", dpi=150)
    return result.diagnosis


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES)
