"""The common tap test: X, then Y at the tip with one accelerometer; from recordings to limits."""

import importlib.util
import re
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from simulated_taps import Bench, Hits, Structure, write_taps

from estimation import Frf, FrfMapping, import_frf, read_frf, read_frf_uff, write_frf, write_frf_uff
from millfrf.command_line import DONE, run
from millfrf.core import FileFormatError, InputError, read_csv
from millfrf.cutting import MillingProcess
from millfrf.gate import check_tip_and_sensor, cross_term_warnings
from millfrf.stability import certified_lobes, cross_term_effect, zero_order
from modal_fit import ModalModel, fit_polyreference, read_modal_model

CUT = """[cutting]
teeth = 2
diameter_m = 0.02
ktc_pa = 8e8
krc = 0.3
kac = 0.0
immersion = "slot"
"""
RPM = np.pi / 30
SPEEDS = ("9000", "13000", "3")


def tip(apart: float) -> Structure:
    """Two modes each in X and in Y, those in Y a share ``apart`` higher."""
    natural = np.array([1067.0, 2610.0])
    none = np.zeros(2)
    shape = np.array([1.0, 1.6])
    return Structure(
        np.concatenate([natural, natural * (1 + apart)]),
        np.array([0.03, 0.022, 0.03, 0.022]),
        {"TCP:+X": np.concatenate([shape, none]), "TCP:+Y": np.concatenate([none, shape])},
    )


def truth(structure: Structure) -> ModalModel:
    names = ("TCP:+X", "TCP:+Y")
    shapes = np.column_stack([structure.shapes[name] for name in names]).astype(complex)
    return ModalModel(structure.poles, shapes / (2j * structure.poles.imag[:, None]), shapes, names, names)


def tapped(folder: Path, structure: Structure) -> list[str]:
    """``x.h5`` and ``y.h5``: five taps each in one direction, and the accelerometer along it."""
    for seed, axis in enumerate("XY"):
        place = f"TCP:+{axis}"
        hits = Hits((0.1, 0.45, 0.8, 1.15, 1.5), at=place, width=1.2e-4)
        bench = Bench(rate=12800.0, seconds=1.85, noise=2e-3, seed=seed)
        write_taps(folder / f"{axis.lower()}.h5", structure, hits, (place,), bench)
    return ["x.h5", "y.h5"]


@pytest.fixture(scope="module")
def floquet() -> ModuleType:
    file = Path(__file__).parents[2] / "stability" / "independent_floquet.py"
    spec = importlib.util.spec_from_file_location("independent_floquet", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["independent_floquet"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("apart", [0.0, 0.004])
def test_three_commands_from_two_taps_to_the_true_limits(
    apart: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    floquet: ModuleType,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Before: refused; with zeros forged in, Y's mode was lost, and no limit was drawn where there is one."""
    monkeypatch.chdir(tmp_path)
    structure = tip(apart)
    Path("cut.toml").write_text(CUT)
    assert run(["tap", *tapped(tmp_path, structure), "--out", "tip.h5"]) == DONE
    assert "not measured and 0: TCP:+X / TCP:+Y, TCP:+Y / TCP:+X" in capsys.readouterr().out
    begun = time.process_time()
    assert run(["fit", "tip.h5", "--out", "tip.json"]) == DONE
    assert time.process_time() - begun < 20
    model = read_modal_model("tip.json")
    order = np.argsort(structure.frequencies, kind="stable")
    np.testing.assert_allclose(model.natural_frequencies, structure.frequencies[order], rtol=5e-4)
    np.testing.assert_allclose(model.damping_ratios, structure.damping[order], rtol=0.02)
    assert (np.abs(model.right).astype(bool).sum(axis=1) == 1).all()
    for source, rtol in (("tip.json", 0.03), ("tip.h5", 0.03)):
        command = ["lobes", source, "--cutting", "cut.toml", "--speeds", *SPEEDS, "--max-depth", "0.01", "--force"]
        assert run([*command, "--out", "lobes.csv"]) == DONE
        said = capsys.readouterr()
        assert "was not measured and is taken as 0: small cross terms, +-5 %" in said.err
        assert "3 resting on dynamics that were not measured" in said.out
        assert ("mode coupling in a cut without regeneration: not known" in said.out) == source.endswith("json")
        rows = [line.split(",") for line in Path("lobes.csv").read_text().splitlines() if line[0].isdigit()]
        assert len(rows) == 3
        mill = floquet.Mill(2, np.pi / 2, 8e8, 0.3, 0.0, 0.0, np.pi)
        for rpm, depth, *_ in rows:
            system = truth(structure)
            wide = [np.column_stack([part, np.zeros(len(part))]) for part in (system.right, system.left)]
            radii = [
                floquet.spectral_radius(system.poles, *wide, mill, float(rpm) * np.pi / 30, float(depth) * (1 + side))
                for side in (-rtol, rtol)
            ]
            assert radii[0] < 1 < radii[1], (source, rpm, depth, radii)


def test_the_recommended_cut_is_stable_whatever_the_cross_terms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, floquet: ModuleType
) -> None:
    """Equal modes in X and Y may be one mode at 45 or at -45 degrees: the direct terms are the same."""
    monkeypatch.chdir(tmp_path)
    structure = tip(0.0)
    Path("cut.toml").write_text(CUT)
    assert run(["tap", *tapped(tmp_path, structure), "--out", "tip.h5"]) == DONE
    assert run(["fit", "tip.h5", "--out", "tip.json"]) == DONE
    command = ["lobes", "tip.json", "--cutting", "cut.toml", "--speeds", "12400", "12600", "2", "--max-depth", "0.01"]
    assert run([*command, "--out", "lobes.csv"]) == DONE
    assert run(["report", "tip.json", "cut.toml", "lobes.csv", "--out", "page.html"]) == DONE
    page = Path("page.html").read_text()
    assert "cross terms that were not measured are deducted: they leave" in page
    [depth, rpm] = re.findall(r"drift of 2 %: ([\d.]+) mm at (\d+) rpm", page)[0]
    assert 0.2 < float(depth) < 3.3
    mill, poles = floquet.Mill(2, np.pi / 2, 8e8, 0.3, 0.0, 0.0, np.pi), structure.poles[:2]
    for angle in (0.0, 1.0, -1.0):
        left = np.outer([1.0, 1.6], [1.0, angle, 0.0])
        right = left / (2j * poles.imag[:, None])
        assert floquet.spectral_radius(poles, right, left, mill, float(rpm) * RPM, float(depth) / 1e3) < 1


def test_a_low_band_of_an_accelerance_makes_no_flexibility(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Terms below the band grow with ``1/f^2``; their mean from 2 Hz on was six times the modes' flexibility."""
    monkeypatch.chdir(tmp_path)
    assert run(["tap", *tapped(tmp_path, tip(0.004)), "--out", "tip.h5"]) == DONE
    frf, process = read_frf("tip.h5"), cut()
    assert frf.band is not None
    assert frf.band[0] < 20
    fitted = fit_polyreference(frf, frf.band)
    speeds = np.linspace(9000.0, 30000.0, 5) * np.pi / 30
    result, true = (certified_lobes(model, process, speeds, 0.01) for model in (fitted.model, truth(tip(0.004))))
    np.testing.assert_allclose(result.depth_limits, true.depth_limits, rtol=0.03)


def cut() -> MillingProcess:
    return MillingProcess(2, 0.02, np.pi / 2, 8e8, 0.3, 0.0, np.pi / 2, np.pi, 1e-4)


def test_the_effect_of_cross_terms_is_that_of_a_model_that_has_them() -> None:
    """Equal directions: ``H_xy = 0.05 H_xx`` are shapes ``(1, 1)``, ``(1, -1)`` with 1.05, 0.95 of the residue."""
    model = truth(tip(0.0))
    diagonal = replace(model, measured=np.eye(2, dtype=bool))
    speeds = np.linspace(8000.0, 15000.0, 4) * np.pi / 30
    effect = cross_term_effect(diagonal, cut(), speeds, 0.05)
    assert effect is not None
    assert cross_term_effect(model, cut(), speeds, 0.05) is None
    changes = []
    for sign in (1, -1):
        both, across = np.array([0.5, 0.5 * sign]), np.array([0.5, -0.5 * sign])
        shapes = [np.outer(model.right[:2, 0], both), np.outer(model.right[:2, 0], across)]
        left = np.concatenate([np.outer(model.left[:2, 0], 2 * part) for part in (both, across)])
        crossed = replace(model, right=np.concatenate([shapes[0] * 1.05, shapes[1] * 0.95]), left=left)
        term = crossed.receptance(np.array([1000.0]))[0]
        np.testing.assert_allclose(term[0, 1], 0.05 * sign * term[0, 0], rtol=1e-9)
        alone, with_terms = (certified_lobes(each, cut(), speeds, 0.05).depth_limits for each in (model, crossed))
        changes.append(with_terms / alone - 1)
    assert effect.lowered == pytest.approx(-np.min(changes), abs=2e-3)
    assert effect.raised == pytest.approx(np.max(changes), abs=2e-3)
    assert effect.lowered > 0.003
    [said] = cross_term_warnings(diagonal, cut(), speeds, 0.05)
    assert "at 1067, 2610 Hz both directions have a mode" in said


def test_one_recording_with_both_directions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The accelerometer is moved in the middle; a table says when."""
    monkeypatch.chdir(tmp_path)
    structure, place = tip(0.004), "TCP:+X"
    times, bench = (0.1, 0.45, 0.8), Bench(rate=12800.0, seconds=1.15, noise=2e-3)
    write_taps(Path("x.h5"), structure, Hits(times, at=place, width=1.2e-4), (place,), bench)
    Path("points.csv").write_text("file,hit,from_s,to_s,a1\nx.h5,TCP:+X,0,0.7,TCP:+X\nx.h5,TCP:+Y,0.7,9,TCP:+Y\n")
    assert run(["tap", "x.h5", "--points", "points.csv", "--out", "tip.h5"]) == DONE
    frf = read_frf("tip.h5")
    assert frf.measured is not None
    np.testing.assert_array_equal(frf.measured, np.eye(2, dtype=bool))
    np.testing.assert_array_equal(frf.averages, [[2, 0], [0, 1]])


def frf_of(model: ModalModel) -> Frf:
    frequencies = np.arange(200.0, 4000.0, 2.0)
    return replace(model.frf(frequencies), measured=np.eye(2, dtype=bool))


def test_files_state_what_was_not_measured(tmp_path: Path) -> None:
    frf = frf_of(truth(tip(0.004)))
    write_frf(tmp_path / "tip.h5", frf)
    read = read_frf(tmp_path / "tip.h5")
    assert read.measured is not None
    np.testing.assert_array_equal(read.measured, np.eye(2, dtype=bool))
    assert "not measured, taken as 0: TCP:+X / TCP:+Y, TCP:+Y / TCP:+X" in repr(read)
    write_frf_uff(tmp_path / "tip.uff", frf)
    again = read_frf_uff(tmp_path / "tip.uff")
    np.testing.assert_array_equal(again.measured, frf.measured)
    np.testing.assert_allclose(again.values, frf.values)
    assert [block.responses for block in frf.blocks()] == [("TCP:+X",), ("TCP:+Y",)]


def test_values_of_entries_that_were_not_measured_are_refused() -> None:
    whole = truth(tip(0.004)).frf(np.arange(200.0, 4000.0, 2.0))
    with pytest.raises(InputError, match="values in entries that were not measured"):
        replace(whole, values=whole.values + 1e-9, measured=np.eye(2, dtype=bool))
    with pytest.raises(InputError, match="not made of whole blocks"):
        replace(whole, measured=np.array([[True, True], [False, True]]))


def exported(folder: Path, frf: Frf) -> None:
    for k, axis in enumerate("xy"):
        values = frf.values[:, k, k]
        table = np.column_stack([frf.frequencies, values.real * 1e6, values.imag * 1e6])
        np.savetxt(
            folder / f"{axis}.csv", table, delimiter=",", header="Frequency (Hz),Real (um/N),Imag (um/N)", comments=""
        )


def test_direct_terms_of_another_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two CSV files, the mapping that ``new mapping`` writes for them, and the three commands."""
    monkeypatch.chdir(tmp_path)
    frf = frf_of(truth(tip(0.004)))
    exported(tmp_path, frf)
    assert run(["new", "mapping", "x.csv", "y.csv", "--out", "tip.toml"]) == DONE
    assert run(["convert", "x.csv", "y.csv", "tip.h5", "--map", "tip.toml"]) == DONE
    read = read_frf("tip.h5")
    np.testing.assert_array_equal(read.measured, np.eye(2, dtype=bool))
    np.testing.assert_allclose(read.values, frf.values, rtol=1e-9)


def test_a_matrix_with_zeros_in_its_cross_terms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No measurement is exactly 0 on every line."""
    monkeypatch.chdir(tmp_path)
    frf = frf_of(truth(tip(0.004)))
    np.savez("tip.npz", f=frf.frequencies, H=frf.values)
    Path("tip.toml").write_text(
        '[frf]\nfrequency = "f"\nvalues = "H"\nunit = "m/N"\naxes = ["frequency", "response", "excitation"]\n'
        'responses = ["TCP:+X", "TCP:+Y"]\n'
        'excitations = ["TCP:+X", "TCP:+Y"]\n'
    )
    assert run(["convert", "tip.npz", "tip.h5", "--map", "tip.toml"]) == DONE
    np.testing.assert_array_equal(read_frf("tip.h5").measured, np.eye(2, dtype=bool))


def test_an_incomplete_block_is_still_refused(tmp_path: Path) -> None:
    frf = frf_of(truth(tip(0.004)))
    np.savez(tmp_path / "tip.npz", f=frf.frequencies, H=frf.values[:, 0, 0])
    entries = [("TCP:+X", "TCP:+X"), ("TCP:+X", "TCP:+Y"), ("TCP:+Y", "TCP:+Y")]
    mapping = FrfMapping.model_validate(
        {
            "frf": {"frequency": "f", "values": "H", "unit": "m/N"},
            "entries": [{"response": p, "excitation": q} for p, q in entries],
        }
    )
    with pytest.raises(FileFormatError, match=r"lacks TCP:\+Y / TCP:\+X"):
        import_frf([tmp_path / "tip.npz"], mapping)


def test_covariance_and_errors_of_joined_directions_are_those_of_each(tmp_path: Path) -> None:
    """Modes interleave: X, Y, X, Y; each keeps its own errors, and both directions are independent."""
    model = truth(tip(0.004))
    clean = frf_of(model)
    rng = np.random.default_rng(5)
    noise = 2e-10 * (rng.normal(size=clean.values.shape) + 1j * rng.normal(size=clean.values.shape))
    frf = replace(clean, values=np.where(np.eye(2, dtype=bool), clean.values + noise, 0))
    joined = fit_polyreference(frf, (200.0, 3998.0)).model
    alone = [fit_polyreference(block, (200.0, 3998.0)).model for block in frf.blocks()]
    for k, own in enumerate(alone):
        np.testing.assert_array_equal(joined.poles[k::2], own.poles)
        assert joined.errors is not None
        assert own.errors is not None
        np.testing.assert_array_equal(joined.errors.noise[k::2], own.errors.noise)
    whole = replace(joined, errors=None).standard_errors()
    assert whole is not None
    for k, own in enumerate(alone):
        parts = replace(own, errors=None).standard_errors()
        assert parts is not None
        for errors, own_errors in zip(whole, parts, strict=True):
            np.testing.assert_allclose(errors[k::2], own_errors)
    lines = np.array([900.0, 1500.0])
    np.testing.assert_allclose(joined.receptance(lines)[:, 0, 0], alone[0].receptance(lines)[:, 0, 0])
    assert not joined.receptance(lines)[:, 0, 1].any()


def test_band_of_lobes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A smooth error of an integrated acceleration at the lower end sets no limit."""
    monkeypatch.chdir(tmp_path)
    structure = tip(0.004)
    model = truth(structure)
    frequencies = np.arange(1.0, 4000.0, 2.0)
    values = model.receptance(frequencies)
    direct = np.eye(2, dtype=bool)
    # leakage: an acceleration of constant phase, against the force and returning power
    error = (0.05 - 0.02j) / (2 * np.pi * frequencies[:, None]) ** 2 / (1 + (frequencies[:, None] / 120) ** 4)
    values[:, direct] -= error
    frf = Frf(
        frequencies, values, model.responses, model.excitations, "receptance", "m/N", frequencies > 0, measured=direct
    )
    write_frf("tip.h5", frf)
    speeds = np.linspace(9000.0, 30000.0, 5) * np.pi / 30
    true = zero_order(model, cut(), speeds, 0.05).depth_limits
    np.testing.assert_allclose(zero_order(frf, cut(), speeds, 0.05).depth_limits, true, rtol=0.03)
    Path("cut.toml").write_text(CUT)
    true = zero_order(model, replace(cut(), start_angle=0.0), speeds, 0.02).depth_limits
    command = ["lobes", "tip.h5", "--cutting", "cut.toml", "--speeds", "9000", "30000", "5", "--max-depth", "0.02"]
    assert run([*command, "--method", "zero-order", "--band", "500", "3500", "--out", "lobes.csv"]) == DONE
    assert "is the FRF in mm/N" not in capsys.readouterr().err
    table = read_csv("lobes.csv")
    assert table.provenance["options"]["band_hz"] == [500.0, 3500.0]
    limits = [float(row[1]) for row in table.rows]
    np.testing.assert_allclose(limits, true, rtol=0.03)


def test_direct_terms_do_not_calibrate_a_model_of_the_cut() -> None:
    model = truth(tip(0.004))
    with pytest.raises(InputError, match=r"lacks TCP:\+X / TCP:\+Y, TCP:\+Y / TCP:\+X \(not measured\)"):
        check_tip_and_sensor(model, frf_of(model), model.frf(np.arange(200.0, 4000.0, 2.0)))
