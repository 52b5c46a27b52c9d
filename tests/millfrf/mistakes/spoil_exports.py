"""FRFs as another program exports them, with its mistakes."""

from pathlib import Path

from estimation import read_frf, write_frf_uff


def analyser(folder: Path, file: str, unit: str = "m/N", change: str = "") -> None:
    """The tool tip's first FRF as an analyser exports it, and its mapping; ``conjugated`` for exp(-i w t)."""
    frf = read_frf(folder / "frf_tip.h5")
    values = frf.values[:, 0, 0].conj() if change == "conjugated" else frf.values[:, 0, 0]
    rows = (f"{f:.6e}\t{h.real:.9e}\t{h.imag:.9e}" for f, h in zip(frf.frequencies, values, strict=True))
    header = f"Analyser\n\nFrequency\tReal\tImaginary\nHz\t{unit}\t{unit}\n"
    (folder / file).write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    labels = f'responses = ["{frf.responses[0]}"]\nexcitations = ["{frf.excitations[0]}"]\n'
    (folder / "frf.toml").write_text("[frf]\n" + labels, encoding="utf-8")


def exported(folder: Path, file: str) -> None:
    """The tool tip's FRFs as a UFF file."""
    write_frf_uff(folder / file, read_frf(folder / "frf_tip.h5"), binary=False)


def records(folder: Path, file: str) -> None:
    """The same data sets, called time records (function type 1)."""
    exported(folder, file)
    text = (folder / file).read_text(encoding="utf-8")
    (folder / file).write_text(
        text.replace("    4         0    0         0", "    1         0    0         0"), encoding="utf-8"
    )
