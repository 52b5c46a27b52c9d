"""Texts of any separator, decimal sign, encoding, preamble, clock and gap: written, and read equal or refused by name.

The writer below is independent of the reader: it formats each cell by itself.
"""

import datetime
import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition import Recording, TextOptions, convert, open_arrays
from acquisition.conversion.sample_axis import measured_axis
from acquisition.conversion.text_table import read_text_table, table_of_lines
from millfrf.core import FileFormatError, InputError

N = 60
DATA = np.round(np.random.default_rng(4).normal(0, 30, (N, 2)), 4)
MAPPING = """{clock}
[[channels]]
name = "Fz"
quantity = "force"
unit = "N"
column = {force}
[[channels]]
name = "acc"
quantity = "acceleration"
unit = "{unit}"
column = {motion}
"""
PREAMBLES = {
    "none": [],
    "words": ["Rig 4, run 7", "", "Operator: N. N."],
    "keys": ["Date{0}2026-03-02", "Samples{0}60", "Rate{0}1000{0}Hz", ""],
    "notes": ["# exported by a logger", "# run 7"],
}

PLAIN = {"encoding": "utf-8", "packed": False}

layouts = st.fixed_dictionaries(
    {
        "separator": st.sampled_from([",", ";", "\t", " ", "  "]),
        "decimal": st.sampled_from([".", ","]),
        "encoding": st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le"]),
        "packed": st.booleans(),
        "preamble": st.sampled_from(sorted(PREAMBLES)),
        "headings": st.sampled_from(["brackets", "row", "none"]),
        "quoted": st.booleans(),
        "trailing": st.booleans(),
        "line_end": st.sampled_from(["\n", "\r\n"]),
        "clock": st.sampled_from(["s", "ms", "us", "iso", "time of day"]),
        "rate": st.sampled_from([100.0, 1000.0, 2048.0, 48000.0]),
        "start": st.sampled_from([0.0, -0.125, 36.7]),
        "unit": st.sampled_from(["m/s^2", "g", "mm/s^2"]),
        "gap": st.sampled_from([0, 1, 17]),
    }
)


def cell(number: float, digits: int, layout: dict[str, object]) -> str:
    text = f"{number:.{digits}f}".replace(".", str(layout["decimal"]))
    return f'"{text}"' if layout["quoted"] else text


def stamp(seconds: float, layout: dict[str, object]) -> str:
    """A time as the clock of the layout prints it, to 0.1 us."""
    scale = {"s": 1.0, "ms": 1e3, "us": 1e6}.get(str(layout["clock"]))
    if scale is not None:
        return cell(seconds * scale, {1.0: 9, 1e3: 6, 1e6: 3}[scale], layout)
    moment = datetime.datetime(2026, 3, 2, 23, 59, 59) + datetime.timedelta(seconds=int(seconds // 1))
    fraction = f"{seconds % 1:.7f}"[1:].replace(".", str(layout["decimal"]))
    day = "%Y-%m-%dT" if layout["clock"] == "iso" else ""
    text = f"{moment:{day}%H:%M:%S}{fraction}"
    return f'"{text}"' if layout["quoted"] else text


def text_of(layout: dict[str, object]) -> str:
    separator, unit = str(layout["separator"]), str(layout["unit"])
    is_clock = layout["clock"] in ("iso", "time of day")
    time_unit = "" if is_clock else str(layout["clock"])
    names, units = ["Time", "Fz", "acc_z"], [time_unit, "N", unit]
    headings = {
        "brackets": [[f"{name} ({u})" if u else name for name, u in zip(names, units, strict=True)]],
        "row": [names, [u or "-" for u in units]],
        "none": [],
    }[str(layout["headings"])]
    lines = [line.format(separator) for line in PREAMBLES[str(layout["preamble"])]]
    lines += [separator.join(cells) for cells in headings]
    for k, (force, motion) in enumerate(DATA):
        step = k + (int(str(layout["gap"])) if k >= 25 else 0)
        time = float(str(layout["start"])) * (not is_clock) + step / float(str(layout["rate"]))
        lines.append(separator.join([stamp(time, layout), cell(force, 4, layout), cell(motion, 4, layout)]))
    end = separator if layout["trailing"] and separator.strip() else ""
    return "".join(
        f"{line}{end if line and number >= len(PREAMBLES[str(layout['preamble'])]) else ''}" + str(layout["line_end"])
        for number, line in enumerate(lines)
    )


def is_readable(layout: dict[str, object]) -> bool:
    """Whether the text has one meaning: commas that are both signs need quotes, clocks no blank decimals."""
    both = layout["separator"] == "," == layout["decimal"]
    return bool(layout["quoted"]) if both else True


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(layout=layouts)
def test_what_was_written_is_read_or_refused_by_name(tmp_path: Path, layout: dict[str, object]) -> None:
    path = tmp_path / ("a.csv.gz" if layout["packed"] else "a.csv")
    data = text_of(layout).encode(str(layout["encoding"]))
    path.write_bytes(gzip.compress(data) if layout["packed"] else data)
    named = layout["headings"] != "none"
    columns = {"force": 2, "motion": 3}
    clock = "time = 1" if named or layout["clock"] not in ("ms", "us") else f'time = 1\ntime_unit = "{layout["clock"]}"'
    (tmp_path / "map.toml").write_text(MAPPING.format(clock=clock, unit=layout["unit"], **columns))
    out = tmp_path / "out.h5"
    out.unlink(missing_ok=True)
    if not is_readable(layout):
        with pytest.raises(InputError, match=r"decimal|not like|no rows|no column"):
            convert(path, out, tmp_path / "map.toml")
        return
    convert(path, out, tmp_path / "map.toml")
    gap, n = int(str(layout["gap"])), N + int(str(layout["gap"]))
    rows = np.concatenate([np.arange(25), np.arange(25 + gap, n)])
    with Recording(out) as recording:
        stream = recording.stream()
        samples = stream.read()
    factor = {"m/s^2": 1.0, "g": 9.80665, "mm/s^2": 1e-3}[str(layout["unit"])]
    assert stream.n_samples == n
    rate = float(str(layout["rate"]))
    assert stream.sample_rate == pytest.approx(rate, rel=max(1e-5, 2e-7 * rate / N))  # clocks are printed to 0.1 us
    if layout["clock"] not in ("iso", "time of day"):
        assert stream.start_time == pytest.approx(float(str(layout["start"])), abs=1e-6)
    np.testing.assert_allclose(samples[rows], DATA * [1.0, factor], rtol=1e-6)
    assert np.isnan(np.delete(samples, rows, axis=0)).all()


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    layout=layouts,
    row=st.integers(1, N - 2),
    note=st.sampled_from(["Time{0}Fz{0}acc_z", "tool changed", "0{0}1", "1{0}2{0}3{0}4", "-{0}-{0}-", "Time{0}1{0}2"]),
)
def test_a_line_among_the_rows_is_refused_by_its_number(
    tmp_path: Path, layout: dict[str, object], row: int, note: str
) -> None:
    layout = layout | {
        "decimal": ".",
        "quoted": False,
        "trailing": False,
        "gap": 0,
        "encoding": "utf-8",
        "packed": False,
    }
    lines = text_of(layout | {"line_end": "\n"}).split("\n")
    place = len(lines) - 1 - N + row
    lines.insert(place, note.format(layout["separator"]))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=rf"line {place + 1}\b"):
        read_text_table(tmp_path / "a.csv")


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(layout=layouts, row=st.integers(1, N - 2), blank=st.sampled_from(["", "   ", "# pause"]))
def test_blank_lines_among_the_rows_are_said(tmp_path: Path, layout: dict[str, object], row: int, blank: str) -> None:
    layout = layout | {"decimal": ".", "quoted": False, "gap": 0, **PLAIN}
    lines = text_of(layout | {"line_end": "\n"}).split("\n")
    place = len(lines) - 1 - N + row
    lines.insert(place, blank)
    (tmp_path / "a.csv").write_text("\n".join(lines))
    table = read_text_table(tmp_path / "a.csv")
    np.testing.assert_allclose(table.values[:, 1:], DATA, rtol=1e-12)
    assert f"1 blank or # among them passed over, the first in line {place + 1}" in table.account


def test_lines_left_out_by_the_user_are_counted(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,F\n0,1\n1,2\nnew part\nt,F\n2,3\n3,4\n")
    table = read_text_table(tmp_path / "a.csv", TextOptions(skip_lines=4))
    assert table.account == "2 rows read from lines 6 to 7; 4 lines left out by skip_lines, 2 of them rows of numbers"
    with pytest.raises(FileFormatError, match=r"line 4 .*skip_lines = 3 leaves out all lines above it"):
        open_arrays(tmp_path / "a.csv")


steps = st.floats(1e-6, 1.0)


@settings(deadline=None, max_examples=200)
@given(step=steps, start=st.floats(-10, 1e3), gap=st.integers(0, 50), row=st.integers(2, 150), n=st.integers(160, 400))
def test_an_axis_of_bits_is_measured_with_its_gap(step: float, start: float, gap: int, row: int, n: int) -> None:
    counts = np.arange(n) + gap * (np.arange(n) >= row)
    axis = measured_axis(start + step * counts, "t")
    assert axis.rate * step == pytest.approx(1, rel=1e-5)
    assert axis.start == start
    assert [(each.row, each.missing) for each in axis.gaps] == ([(row, gap)] if gap else [])


@settings(deadline=None, max_examples=200)
@given(
    digits=st.integers(4, 7),
    rate=st.floats(90, 2000),
    n=st.integers(300, 900),
    fault=st.sampled_from(["none", "restart", "drift", "half step", "standstill"]),
    row=st.integers(100, 200),
)
def test_rounded_times_are_even_and_faults_are_not(digits: int, rate: float, n: int, fault: str, row: int) -> None:
    """Times printed with few digits pass as even; a clock that restarts, drifts, stands or jumps by half a step not."""
    step = 1 / rate
    t = step * np.arange(n)
    if fault == "restart":
        t[row:] -= t[row] - t[1]
    if fault == "drift":
        t += 3 * step * (np.arange(n) / n) * (1 - np.arange(n) / n) * 4
    if fault == "half step":
        t[row:] += 0.5 * step
    if fault == "standstill":
        t[row:] -= step
    printed = np.round(t, digits)
    resolution = 10.0**-digits
    if fault == "none":
        axis = measured_axis(printed, "t", "s", None, resolution)
        assert axis.rate == pytest.approx(rate, rel=3 * resolution / t[-1] + 2e-6)
        assert not axis.gaps
    elif resolution < 0.1 * step:
        with pytest.raises(FileFormatError):
            measured_axis(printed, "t", "s", None, resolution)


def test_times_coarser_than_the_steps_pass_as_even() -> None:
    """A logger that prints milliseconds at 2048 Hz repeats stamps; the rate is that of the ends."""
    axis = measured_axis(np.round(np.arange(5000) / 2048, 3), "t", "s", None, 1e-3)
    assert axis.rate == pytest.approx(2048, rel=1e-3)
    with pytest.raises(FileFormatError, match="not evenly spaced"):
        measured_axis(np.round((np.arange(5000) + 40 * (np.arange(5000) > 900)) / 2048, 3), "t", "s", None, 1e-3)


def test_times_printed_without_their_zeros_keep_their_digits() -> None:
    """A last time of ``2`` was not rounded to seconds."""
    lines = ["t (s),F (N)", *(f"{k / 1000:g},1.5" for k in range(1000, 2001) if k != 1500)]
    table = table_of_lines(Path("a.csv"), lines, TextOptions())
    axis = measured_axis(table.values[:, 0], "t", "s", None, table.resolutions[0])
    assert [(gap.row, gap.missing) for gap in axis.gaps] == [(500, 1)]


@pytest.mark.parametrize("clock", ["seconds", "stamps"])
def test_a_sheet_of_a_workbook_is_a_table(tmp_path: Path, clock: str) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    book = openpyxl.Workbook()
    begin = datetime.datetime(2026, 3, 2, 10)
    book.active.append(["Time (s)" if clock == "seconds" else "Time", "Fz (N)", "acc_z (g)"])
    for k, (force, motion) in enumerate(DATA):
        time = k / 100 if clock == "seconds" else begin + datetime.timedelta(seconds=k / 100)
        book.active.append([time, force, motion])
    book.save(tmp_path / "a.xlsx")
    convert(tmp_path / "a.xlsx", tmp_path / "out.h5")
    with Recording(tmp_path / "out.h5") as recording:
        assert recording.stream().sample_rate == 100.0
        np.testing.assert_allclose(recording.stream().read(), DATA * [1, 9.80665], rtol=1e-6)


def test_columns_of_texts_beside_the_first_rows_are_left_out_and_said(tmp_path: Path) -> None:
    """As Tektronix writes them: the preamble stands in the first columns of the first rows."""
    notes = ["Record Length,60,", "Vertical Units,V,", "Model,TDS 1,"] + [",,"] * (N - 3)
    (tmp_path / "a.csv").write_text(
        "".join(f"{note}{k / 1000:.6f},{a},\n" for k, (note, a) in enumerate(zip(notes, DATA[:, 0], strict=True)))
    )
    table = read_text_table(tmp_path / "a.csv")
    np.testing.assert_allclose(table.values, np.column_stack([np.arange(N) / 1000, DATA[:, 0]]))
    assert table.account == "60 rows read from lines 1 to 60; columns without numbers left out: 1, 2"


def test_a_column_of_texts_is_left_out_and_said(tmp_path: Path) -> None:
    rows = [f"{k / 1000:.3f};{a};{'normal' if k % 3 else 'high'}" for k, a in enumerate(DATA[:, 0])]
    (tmp_path / "a.csv").write_text("\n".join(["t (s);F (N);state", *rows]) + "\n")
    table = read_text_table(tmp_path / "a.csv")
    assert table.headings == ("t (s)", "F (N)")
    assert table.account == "60 rows read from lines 2 to 61; columns without numbers left out: 3"
    np.testing.assert_allclose(table.values[:, 1], DATA[:, 0])


def test_labview_without_times_states_names_units_and_rate(tmp_path: Path) -> None:
    """The column of times is blank, and counts stand in the header: they are no rows."""
    header = (
        "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t60\t60\t\nY_Unit_Label\tNewtons\tm/s^2\t\nX_Dimension\tTime\tTime\t\n"
        "X0\t0,5E+0\t0,5E+0\t\nDelta_X\t1,25E-4\t1,25E-4\t\n***End_of_Header***\t\t\t\n"
        "X_Value\tHammer z\tacc_z\tComment\n"
    )
    rows = [f"\t{a}\t{b}".replace(".", ",") for a, b in DATA]
    (tmp_path / "a.lvm").write_text(header + "\n".join(rows) + "\n")
    convert(tmp_path / "a.lvm", tmp_path / "out.h5")
    with Recording(tmp_path / "out.h5") as recording:
        stream = recording.stream()
        assert [channel.name for channel in stream.channels] == ["Hammer z", "acc_z"]
        assert (stream.sample_rate, stream.start_time) == (8000.0, 0.5)
        np.testing.assert_allclose(stream.read(), DATA, rtol=1e-6)


measurements = st.fixed_dictionaries(
    {
        "separator": st.sampled_from(["\t", ","]),
        "decimal": st.sampled_from([".", ","]),
        "times": st.sampled_from(["No", "One", "Multi"]),
        "comments": st.sampled_from(["none", "few", "all"]),
        "n_rows": st.integers(4, N),
        "rate": st.sampled_from([8000.0, 25600.0, 51200.0]),
        "start": st.sampled_from([0.0, 0.5, -0.25]),
        "line_end": st.sampled_from(["\n", "\r\n"]),
    }
)


def labview_text(made: dict[str, object]) -> str:
    """A LabVIEW Measurement File of two channels, its times nowhere, once, or before each channel."""
    separator, n = str(made["separator"]), int(str(made["n_rows"]))
    step, start = 1 / float(str(made["rate"])), float(str(made["start"]))

    def number(value: float) -> str:
        return f"{value:.9f}".replace(".", str(made["decimal"]))

    def two(key: str, text: str, *second: str) -> list[str]:
        return [key, text, *([""] if made["times"] == "Multi" else []), *(second or (text,)), ""]

    lines = [
        *(["LabVIEW Measurement", ""], ["Writer_Version", "2"], ["Decimal_Separator", str(made["decimal"])]),
        *(["X_Columns", str(made["times"])], ["***End_of_Header***", ""], ["", ""], ["Channels", "2", "", ""]),
        *(two("Samples", str(n)), two("Y_Unit_Label", "Newtons", "m/s^2"), two("X_Dimension", "Time")),
        *(two("X0", number(start)), two("Delta_X", number(step)), ["***End_of_Header***", "", "", ""]),
        two("X_Value", "Hammer z (Trigger)", *(["X_Value"] if made["times"] == "Multi" else []), "acc_z")[:-1]
        if made["times"] != "Multi"
        else ["X_Value", "Hammer z (Trigger)", "X_Value", "acc_z"],
    ]
    lines[-1] = [*lines[-1], "Comment"]
    for k in range(n):
        time = number(start + k * step) if made["times"] != "No" else ""
        cells = [time, number(DATA[k, 0]), *([time] if made["times"] == "Multi" else []), number(DATA[k, 1])]
        noted = made["comments"] == "all" or (made["comments"] == "few" and k == 1)
        lines.append([*cells, "LOST COMMUNICATION"] if noted else cells)
    return "".join(separator.join(cells) + str(made["line_end"]) for cells in lines)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(made=measurements)
def test_measurement_files_of_labview_are_read_or_refused_by_name(tmp_path: Path, made: dict[str, object]) -> None:
    """However few rows follow the header of counts; one comment among the rows is refused by its line."""
    (tmp_path / "a.lvm").write_bytes(labview_text(made).encode("cp1252"))
    (tmp_path / "out.h5").unlink(missing_ok=True)
    if made["separator"] == made["decimal"] or made["comments"] == "few":
        with pytest.raises(InputError, match=r"line \d+|decimal"):
            convert(tmp_path / "a.lvm", tmp_path / "out.h5")
        return
    convert(tmp_path / "a.lvm", tmp_path / "out.h5")
    with Recording(tmp_path / "out.h5") as recording:
        stream = recording.stream()
        assert [channel.name.partition(" (")[0] for channel in stream.channels] == ["Hammer z", "acc_z"]
        assert [channel.quantity for channel in stream.channels] == ["force", "acceleration"]
        assert stream.sample_rate == pytest.approx(float(str(made["rate"])), rel=1e-4)
        assert stream.start_time == pytest.approx(float(str(made["start"])), abs=1e-9)
        np.testing.assert_allclose(stream.read(), DATA[: int(str(made["n_rows"]))], rtol=1e-6)


def test_times_too_coarse_for_a_rate_ask_for_it(tmp_path: Path) -> None:
    """Ten samples share a stamp: the rate is known to half a percent, and a rate that is typed must agree."""
    rows = [f"{np.floor(k / 10) / 100:.2f};{k % 7}" for k in range(2000)]
    (tmp_path / "a.csv").write_text("\n".join(["t (s);F (N)", *rows]) + "\n")
    with pytest.raises(InputError, match=r"its digits \(0.01 s\) give the rate to 0.5 % only"):
        convert(tmp_path / "a.csv", tmp_path / "out.h5")
    for rate, agrees in ((1000, True), (1100, False)):
        channel = '[[channels]]\nname = "F"\nquantity = "force"\nunit = "N"\ncolumn = 2\n'
        (tmp_path / "map.toml").write_text(f"sample_rate = {rate}\n{channel}")
        if agrees:
            convert(tmp_path / "a.csv", tmp_path / "out.h5", tmp_path / "map.toml")
            with Recording(tmp_path / "out.h5") as recording:
                assert (recording.stream().sample_rate, recording.stream().n_samples) == (1000.0, 2000)
        else:
            with pytest.raises(InputError, match="sample_rate = 1100 Hz in the mapping"):
                convert(tmp_path / "a.csv", tmp_path / "again.h5", tmp_path / "map.toml")
