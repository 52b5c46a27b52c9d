"""Tables that every program reads: plain CSV, its side file after CSV on the Web, and cells that no program runs."""

import csv
import errno
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import DiskFull, FileFormatError, InputError, harmless, read_csv, side_file, write_csv
from millfrf.core.csv_tables import plain_text
from millfrf.core.provenance import origin, read_provenance
from millfrf.gate import kind_of
from millfrf.stability import StabilityLobes, read_lobes, write_lobes

# W3C, Metadata Vocabulary for Tabular Data, 2015: properties of a table, of a column, and what both inherit
OF_A_TABLE = {"@context", "@id", "@type", "url", "dialect", "notes", "suppressOutput", "tableDirection", "tableSchema"}
OF_A_COLUMN = {"@id", "@type", "name", "suppressOutput", "titles", "virtual"}
INHERITED = {"aboutUrl", "datatype", "default", "lang", "null", "ordered", "propertyUrl", "required", "separator"}
# prefixes of common properties, from the initial context of RDFa that the vocabulary adopts
PREFIXES = {"dc", "dcterms", "schema", "rdfs", "prov", "foaf", "skos", "xsd"}
DATATYPES = {"string", "double", "integer"}


def lobes(warnings: tuple[str, ...] = ("the teeth pass at 150 Hz",)) -> StabilityLobes:
    return StabilityLobes(
        np.array([100.0, 200.0, 300.0]),
        np.array([1.5e-3, np.inf, np.nan]),
        np.array([31.25, np.nan, np.nan]),
        ("hopf", "none", "none"),
        "nyquist",
        warnings,
        ("verified", "verified", "unresolved"),
    )


def check_vocabulary(content: Mapping[str, Any], table: Path) -> None:
    """Raise an assertion where a side file is not a table of CSV on the Web, or does not fit its table."""
    assert content["@context"] == ["http://www.w3.org/ns/csvw", {"@language": "en"}]
    for key in content:
        assert key in OF_A_TABLE or key.partition(":")[0] in PREFIXES
    assert (table.parent / content["url"]).resolve() == table.resolve()
    with table.open(encoding="utf-8", newline="") as stream:
        heading, *rows = list(csv.reader(stream))
    columns = content["tableSchema"]["columns"]
    assert [column["titles"] for column in columns] == heading
    names = [column["name"] for column in columns if "name" in column]
    assert len(set(names)) == len(names)
    for number, column in enumerate(columns):
        for key in column:
            assert key in OF_A_COLUMN | INHERITED or key.partition(":")[0] in PREFIXES
        assert re.fullmatch(r"[A-Za-z][\w.]*", column.get("name", "a"))  # not beginning with _, a variable of a URI
        assert column["datatype"] in DATATYPES
        for row in rows:
            if column["datatype"] == "double" and row[number]:  # xsd:double
                assert re.fullmatch(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|-?INF|NaN", row[number])
    assert all(isinstance(note, dict) and not any(key.startswith("@") for key in note) for note in content["notes"])


def test_lobes_are_read_by_the_library_for_csv(tmp_path: Path) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))  # before: the first line of '#' was taken for the heading
    assert [float(row["spindle_speed_rpm"]) for row in rows] == pytest.approx(lobes().spindle_speeds_rpm)
    assert [float(row["depth_limit_m"] or "nan") for row in rows][:2] == [1.5e-3, math.inf]
    assert rows[0]["status"] == "verified"


def test_lobes_are_read_by_pandas(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    frame = pandas.read_csv(path)
    pandas.testing.assert_frame_equal(
        frame[["spindle_speed_rpm", "depth_limit_m", "status"]],
        lobes().to_frame()[["spindle_speed_rpm", "depth_limit_m", "status"]],
        check_dtype=False,
    )


def test_the_side_file_is_a_table_of_csv_on_the_web(tmp_path: Path) -> None:
    path, model = tmp_path / "lobes.csv", tmp_path / "tip.json"
    model.write_text("{}")
    made = origin("lobes", [model], {"max_depth_m": 0.01})
    write_lobes(path, lobes(), provenance=json.dumps(made))
    content = json.loads(side_file(path).read_text(encoding="utf-8"))
    check_vocabulary(content, path)
    columns = {column["name"]: column for column in content["tableSchema"]["columns"]}
    assert columns["depth_limit_m"]["datatype"] == "double"
    assert [columns[name]["schema:unitText"] for name in ("spindle_speed_rpm", "depth_limit_m")] == ["r/min", "m"]
    assert content["dc:source"] == ["tip.json"]
    assert read_provenance(path) == made
    assert read_lobes(path).warnings == lobes().warnings


def test_tables_of_earlier_versions_are_read(tmp_path: Path) -> None:
    path = tmp_path / "lobes.csv"
    heading = "spindle_speed_rpm,depth_limit_m,chatter_frequency_hz,bifurcation,status"
    path.write_text(
        '# warning: the teeth pass at 150 Hz\n# provenance: {"step": "lobes"}\n'
        f"{heading}\n600,0.0015,31.25,hopf,verified\n700,inf,,none,verified\n"
    )
    again = read_lobes(path)
    assert again.warnings == ("the teeth pass at 150 Hz",)
    assert again.depth_limits.tolist() == [0.0015, np.inf]
    assert read_provenance(path) == {"step": "lobes"}


@pytest.mark.parametrize("content", ["", "[]", '{"notes": []}', '{"url": "lobes.csv", "tableSchema": {}}', "\x00\xff"])
def test_a_foreign_side_file_is_said_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    side_file(path).write_text(content, encoding="latin-1")
    (said,) = read_lobes(path).warnings
    assert said.startswith("lobes.csv-metadata.json is not by millfrf")
    assert read_provenance(path) == {}


def test_a_lost_side_file_is_said_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    side_file(path).unlink()
    (said,) = read_lobes(path).warnings
    assert "has lost lobes.csv-metadata.json" in said


def test_a_table_that_was_changed_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    path.write_bytes(path.read_bytes().replace(b"0.0015", b"0.0045"))
    again = read_lobes(path)
    assert again.depth_limits[0] == 4.5e-3
    assert again.warnings[0] == lobes().warnings[0]
    assert "lobes.csv was changed after it was written" in again.warnings[1]
    write_lobes(tmp_path / "same.csv", lobes())
    assert read_lobes(tmp_path / "same.csv").warnings == lobes().warnings


def test_a_full_disk_leaves_the_old_pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    real = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        real(self, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(DiskFull):
        write_lobes(path, lobes(()))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_side_file_given_instead_of_its_table_is_told(tmp_path: Path) -> None:
    path = tmp_path / "lobes.csv"
    write_lobes(path, lobes())
    with pytest.raises(InputError, match=r"describes the table lobes\.csv; give .*lobes\.csv itself"):
        kind_of(side_file(path))


@given(
    st.lists(
        st.lists(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\x00")), min_size=2, max_size=2)
    )
)
def test_any_text_reads_back_equal_and_nothing_runs(rows: list[list[str]]) -> None:
    for text in (cell for row in rows for cell in row):
        cell = harmless(text)
        assert plain_text(cell) == text
        assert not cell.startswith(("=", "@", "\t", "\r"))
        if cell.startswith(("+", "-")):
            float(cell)  # a number, which every program reads as one


@pytest.mark.parametrize(
    "name", ["=HYPERLINK(1)", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "'=1", "''@x", "\uff1d1"]
)
def test_formulas_in_names_are_harmless_and_read_back(tmp_path: Path, name: str) -> None:
    path = tmp_path / "table.csv"
    write_csv(path, ("pose", name, "depth_m"), [(name, "-S1:+X", -1.5), (" x", "-1e-3", np.inf)])
    with path.open(encoding="utf-8", newline="") as stream:
        cells = [cell for row in csv.reader(stream) for cell in row]
    assert not any(cell.startswith(("=", "+", "@", "\t", "\r", "\uff1d")) for cell in cells)
    assert {cell for cell in cells if cell.startswith("-")} == {"-1.5", "-1e-3"}
    table = read_csv(path)
    assert table.columns == ("pose", name, "depth_m")
    assert table.rows == ((name, "-S1:+X", "-1.5"), (" x", "-1e-3", "INF"))
    check_vocabulary(json.loads(side_file(path).read_text(encoding="utf-8")), path)


def test_numbers_keep_nine_digits_and_missing_ones_are_empty(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    numbers = np.array([[1 / 3, -2e-9], [np.nan, -0.0]])
    write_csv(path, ("x_m", "f_hz"), numbers)
    again = np.array([[float(cell or "nan") for cell in row] for row in read_csv(path).rows])
    np.testing.assert_allclose(again, numbers, rtol=1e-8)


def test_no_text_and_no_heading_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    for content, said in ((b"\xff\xfe\x00", "no CSV table in UTF-8"), (b"# warning: late\n", "no line of headings")):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=said):
            read_csv(path)
