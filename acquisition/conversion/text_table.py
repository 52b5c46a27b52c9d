"""Text exports of any program: lines of header, then columns of numbers or of times of a clock; no row is dropped."""

import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real, counted, is_unit

from .text_lines import (
    BLANKS,
    TextLines,
    TextOptions,
    cells_of,
    is_clock,
    is_mark,
    is_number,
    lines_of,
    may_be_value,
    number_text,
    numbers_with_clocks,
    printed_digit,
    unit_in,
    without_brackets,
)

TEXT_SUFFIXES = (".csv", ".txt", ".asc", ".dat", ".tsv", ".prn", ".lvm", ".gz")

_FREQUENCY_UNITS = ("hz", "khz", "rad/s", "rpm", "cpm")
_SAMPLE = 60  # last lines from which the layout is recognised
_SHOWN = 40  # characters of a line in a message
_FEW = 4  # lines that may be left out as a header with numbers
_NOTE = "#%!"  # characters that begin lines of notes


@dataclass(frozen=True)
class TextTable:
    """Columns of numbers below a header; headings and units are empty texts where the header has none.

    ``resolutions`` are the last digits with which the last rows were printed, ``header`` the cells of the lines above
    them, ``clocks`` the first stamps of columns of clock times by their index; ``account`` says which lines were read.
    """

    path: Path
    headings: tuple[str, ...]
    units: tuple[str, ...]
    values: Real  # (n_rows, n_columns)
    resolutions: tuple[float, ...]
    header: tuple[tuple[str, ...], ...]
    clocks: dict[int, str]
    account: str

    def column(self, place: int | str, part: str) -> int:
        """Return the index of a column, from 0, by its number from 1 or its heading; ``part`` is for messages."""
        if isinstance(place, int) and place <= len(self.headings):
            return place - 1
        same = [k for k, heading in enumerate(self.headings) if heading == place]
        if len(same) == 1:
            return same[0]
        raise InputError(f"{self.path}: {part} = {place!r} is no column of it; it has {self.columns_text()}")

    def columns_text(self) -> str:
        """List the columns by number, heading and unit: ``1 Frequency (Hz), 2 Real``."""
        columns = []
        for number, (heading, unit) in enumerate(zip(self.headings, self.units, strict=True), 1):
            bracket = f"({unit})" if unit and unit not in heading else ""
            columns.append(" ".join(filter(None, (str(number), heading, bracket))))
        return ", ".join(columns)


@dataclass(frozen=True)
class _Layout:
    """Delimiter, decimal sign, number of columns without those (from 0) that are blank or texts in the last rows."""

    delimiter: str
    decimal: str
    width: int
    blank: frozenset[int] = frozenset()
    texts: frozenset[int] = frozenset()

    @property
    def left_out(self) -> frozenset[int]:
        """Return the columns without numbers."""
        return self.blank | self.texts

    def cells(self, line: str) -> list[str]:
        """Split a line into its cells, without those of empty columns."""
        return self.without_empty(cells_of(line, self.delimiter))

    def without_empty(self, cells: list[str]) -> list[str]:
        """Leave out the cells of empty columns, in which oscilloscopes write texts beside the first rows."""
        if not self.left_out or len(cells) != self.width + len(self.left_out):
            return cells
        return [cell for k, cell in enumerate(cells) if k not in self.left_out]

    def mistake(self, line: str) -> str:
        """Say why a line is no row, after its number; empty for a row."""
        cells = self.cells(line)
        unlike = f"({line[:_SHOWN]!r} is not like the rows around it)"
        if len(cells) != self.width:
            return f" has {counted(len(cells), 'column')}, the rows around it have {self.width} {unlike}"
        for number, cell in enumerate(cells, 1):
            if number_text(cell, self.decimal) is None and not is_clock(cell):
                is_other = number_text(cell, "." if self.decimal == "," else ",") is not None
                hint = "; its decimal sign is the other: see decimal under [csv]" if is_other else ""
                return f", column {number}: {cell[:_SHOWN]!r} is not a number{hint} {unlike}"
        return ""

    def is_bare(self, line: str) -> bool:
        """Return whether a line is a row without texts in the columns that are blank in the last rows."""
        cells = cells_of(line, self.delimiter) if self.blank else []
        return self.is_row(line) and not any(cells[k] for k in self.blank)

    def is_row(self, line: str) -> bool:
        return not self.mistake(line)


def read_text_table(path: Path, options: TextOptions | None = None) -> TextTable:
    """Read a table of numbers below any header.

    Delimiter, decimal sign and encoding are recognised unless the options state them. The rows begin with the first
    line that is one, and run to the end of the file: every line below is a row, blank, or a note that begins with
    ``#``, else the file is refused.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A file without rows of numbers, a line among the rows that is none, and a damaged packed file.
    """
    options = options or TextOptions()
    lines = lines_of(path, options.encoding)
    return table_of_lines(path, lines, options)


def table_of_lines(path: Path, lines: Sequence[str], options: TextOptions) -> TextTable:
    """Read a table from the lines of a text, of which the last is not blank; ``path`` is for messages.

    A text of gigabytes is passed line by line, so that only its numbers take memory.
    """
    skipped = options.skip_lines
    stated = re.search(r"^Decimal_Separator[\t,; ]([.,])", "\n".join(lines[:_SAMPLE]), re.MULTILINE)  # of LabVIEW
    if stated is not None and options.decimal is None:
        options = options.model_copy(update={"decimal": stated[1]})
    layout = _layout(path, _last_filled(lines, skipped), options)
    first = next(k for k in range(skipped, len(lines)) if layout.is_bare(lines[k]))
    while first > skipped and layout.blank and layout.is_row(lines[first - 1]):
        first -= 1
    header = [tuple(cells_of(line.lstrip(f"{_NOTE} "), layout.delimiter)) for line in lines[skipped:first]]
    _require_no_row_above(path, lines[skipped:first], first, layout)
    values, clocks = _numbers(path, lines, first, layout)
    headings, units = _header(path, lines[skipped:first], skipped, layout)
    if not any(headings) and options.decimal is None and _may_be_halves(lines[-_SAMPLE:], layout):
        raise FileFormatError(
            f"{path}: {layout.width} columns of whole numbers between commas, every second of one length: commas may "
            'be decimal signs too; write decimal = "." under [csv] of a mapping, or export it with semicolons'
        )
    for column in clocks:
        units = (*units[:column], "s", *units[column + 1 :])
    account = _account(lines, first, skipped, len(values), layout)
    nearest = next((cells for cells in reversed(header) if len(cells) > 1), ())
    if nearest and not any(headings):
        account += f"; no headings found: {len(nearest)} cells stand above {layout.width} columns"
    last = [layout.cells(line) for line in lines[max(first, len(lines) - _SAMPLE) :] if layout.is_row(line)]
    resolutions = tuple(min(map(printed_digit, column)) for column in zip(*last, strict=True))
    return TextTable(path, headings, units, values, resolutions, tuple(header), clocks, account)


def _last_filled(lines: Sequence[str], skipped: int) -> list[str]:
    """Return the last lines that are neither blank nor notes, at most as many as the layout is recognised from."""
    filled = (lines[k] for k in range(len(lines) - 1, skipped - 1, -1))
    return list(islice((line for line in filled if line and not line.startswith("#")), _SAMPLE))[::-1]


def _layout(path: Path, filled: Sequence[str], options: TextOptions) -> _Layout:
    """Find the layout in which most of the last lines are rows; headers differ and may hold numbers.

    One column is a last resort, since it fits any delimiter, and so are columns of texts beside the numbers.
    """
    for least_width, with_texts in ((2, False), (2, True), (1, False)):
        best: tuple[int, _Layout] | None = None
        for decimal in (options.decimal,) if options.decimal else (".", ","):
            for delimiter in (options.delimiter,) if options.delimiter else ("\t", ";", ",", BLANKS):
                if delimiter == decimal and not any('"' in line for line in filled):
                    continue
                blank, texts = _columns_without_numbers(filled[-_SAMPLE // 2 :], delimiter)
                texts = texts if with_texts else frozenset()
                for width, count in _row_widths(filled, delimiter, decimal, blank, texts).items():
                    if width >= least_width and (best is None or count > best[0]):
                        best = count, _Layout(delimiter, decimal, width, blank, texts)
        if best is not None:
            return best[1]
    last = repr(filled[-1][:_SHOWN]) if filled else "empty"
    raise FileFormatError(
        f"{path} holds no rows of numbers (its last line is {last}); export a table, or set delimiter and decimal "
        "under [csv]"
    )


def _may_be_halves(lines: Sequence[str], layout: _Layout) -> bool:
    """Return whether columns may be the whole parts and the decimals of numbers with decimal commas."""
    if layout.delimiter != "," or layout.width % 2 or any("." in line for line in lines):
        return False
    rows = [layout.cells(line) for line in lines if layout.is_row(line)]
    decimals = list(zip(*rows, strict=True))[1::2]
    return all(
        len({len(cell) for cell in column}) == 1 and len(column[0]) > 1 and all(map(str.isdigit, column))
        for column in decimals
    )


def _columns_without_numbers(lines: Sequence[str], delimiter: str) -> tuple[frozenset[int], frozenset[int]]:
    """Return the columns, from 0, that are blank in all of the last rows, and those that are texts in all of them."""
    rows = [] if delimiter == BLANKS else [cells_of(line, delimiter) for line in lines]
    above = next((k for k in range(len(rows), 0, -1) if len(rows[k - 1]) != len(rows[-1])), 0)
    rows = [row for row in rows[above:] if any(map(is_number, row))]  # of a short table, lines of the header too
    if len(rows) < _FEW:
        return frozenset(), frozenset()
    columns = list(zip(*rows, strict=True))
    blank = frozenset(k for k, column in enumerate(columns) if not any(column))
    texts = frozenset(k for k, column in enumerate(columns) if not any(map(may_be_value, column)))
    others = {";": "\t", ",": "\t;"}.get(delimiter, "")
    holds_other = any(sign in line for sign in others for line in lines)
    return blank, frozenset() if holds_other else texts - blank


def _row_widths(
    lines: Sequence[str], delimiter: str, decimal: str, blank: frozenset[int], texts: frozenset[int]
) -> Counter[int]:
    """Count the rows of numbers by their number of columns, without those that are blank or texts."""
    widths: Counter[int] = Counter()
    for line in lines:
        cells = cells_of(line, delimiter)
        numbers = [cell for k, cell in enumerate(cells) if k not in blank | texts]
        is_blank = not any(cells[k] for k in blank if k < len(cells))
        if numbers and is_blank and all(number_text(cell, decimal) is not None or is_clock(cell) for cell in numbers):
            widths[len(numbers)] += 1
    return widths


def _require_no_row_above(path: Path, above: Sequence[str], first: int, layout: _Layout) -> None:
    """Refuse lines directly above the first row that are rows too, but damaged ones."""
    for back, line in enumerate(reversed(above)):
        if line.startswith(tuple(_NOTE)):
            return
        cells = layout.cells(line)
        numbers = [cell for cell in cells if number_text(cell, layout.decimal) is not None or is_clock(cell)]
        is_table = len(numbers) > 1 or (bool(numbers) and layout.delimiter in line)
        if is_table and all(cell in numbers or is_mark(cell) for cell in cells):
            raise FileFormatError(f"{path}: {_unlike(first - back, line, layout)}")
        if len(cells) != layout.width or not (numbers or all(map(is_mark, cells))):
            return
        if not all(cell in numbers or is_mark(cell) for cell in cells) and back:
            return
        raise FileFormatError(f"{path}: {_unlike(first - back, line, layout)}")


def _unlike(number: int, line: str, layout: _Layout) -> str:
    return f"line {number}{layout.mistake(line)}; correct the file, or its layout under [csv] of a mapping"


def _rows(lines: Sequence[str], first: int) -> Iterator[str]:
    return (line for line in islice(lines, first, None) if line and not line.startswith("#"))


def _numbers(path: Path, lines: Sequence[str], first: int, layout: _Layout) -> tuple[Real, dict[int, str]]:
    """Return all rows, (n_rows, width), and the first stamps of columns of clock times."""
    first_cells = layout.cells(lines[first])
    clocks = {k: cell for k, cell in enumerate(first_cells) if number_text(cell, layout.decimal) is None}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if clocks:
                cells = [layout.cells(row) for row in _rows(lines, first)]
                return numbers_with_clocks(cells, layout.width, layout.decimal, clocks), clocks
            plain, delimiter = _plain_rows(lines, first, layout)
            values = np.loadtxt(plain, delimiter=delimiter, ndmin=2, comments=None)
            if values.shape[1] == layout.width:
                return values, {}
    except (ValueError, IndexError, Warning):
        pass
    for number, line in enumerate(islice(lines, first, None), first + 1):
        if line and not line.startswith("#") and not layout.is_row(line):
            more = ""
            if number == len(lines):
                more = ": it is the last line, so that the file is cut short or does not end in rows"
            elif number - first < _FEW:
                more = f"; skip_lines = {number - 1} leaves out all lines above it"
            raise FileFormatError(f"{path}: {_unlike(number, line, layout)}{more}")
    raise FileFormatError(f"{path}: the rows from line {first + 1} on cannot be read; correct the file")


def _plain_rows(lines: Sequence[str], first: int, layout: _Layout) -> tuple[Iterable[str], str | None]:
    """Return rows as `numpy.loadtxt` reads them, and their delimiter; rows that need no change are not copied."""
    delimiter, decimal = layout.delimiter, layout.decimal
    sample = lines[first] + lines[len(lines) - 1]
    is_quoted = lines.holds('"') if isinstance(lines, TextLines) else any('"' in line for line in lines)
    if layout.left_out or is_quoted or re.search(r"\d[dD][+-]?\d", sample):
        cells = map(layout.cells, _rows(lines, first))
        return ("\t".join(number_text(cell, decimal) or "x" for cell in row) for row in cells), "\t"
    rows = _rows(lines, first)
    if delimiter != BLANKS and lines[first].endswith(delimiter):
        rows = (row.removesuffix(delimiter) for row in rows)
    if decimal == ",":
        rows = (row.replace(".", "x").replace(",", ".") for row in rows)  # a number has one decimal sign
    return rows, None if delimiter == BLANKS else delimiter


def _header(path: Path, above: Sequence[str], skipped: int, layout: _Layout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return headings and units of the columns, from the nearest lines above them with as many cells."""
    width = layout.width
    headings: tuple[str, ...] = ("",) * width
    units: tuple[str, ...] = ("",) * width
    rows = [
        (number, cells) for number, line in enumerate(above, skipped + 1) if (cells := _heading_cells(line, layout))
    ]
    if any([cell.lower() for cell in cells[width:]] == ["start", "increment"] for _, cells in rows):
        rows = [(number, cells[:width]) for number, cells in rows]
    if rows and 2 < 2 * len(rows[-1][1]) == width and (layout.delimiter, layout.decimal) == (",", "."):
        raise FileFormatError(
            f"{path}: {len(rows[-1][1])} headings over {width} columns between commas: its commas may be decimal signs "
            "too; export it with semicolons or decimal points"
        )
    for place in range(len(rows) - 1, -1, -1):
        number, row = rows[place]
        of_frequency = bool(row) and len(row) <= width and row[0].strip("[]()").lower() in _FREQUENCY_UNITS
        if not of_frequency and not 2 <= len(row) <= width and len(row) != width:
            continue
        filled = (*row, *[""] * (width - len(row)))
        has_headings = any(len(upper) == width for _, upper in rows[:place])
        if of_frequency or (has_headings and _are_units(row, width)):
            units = tuple(without_brackets(unit) for unit in filled)
        elif len(row) == width and any(row):
            headings = filled
            nearest, lowest = rows[-1]
            if (
                nearest != number
                and not any(units)
                and any(map(str.isalnum, "".join(lowest)))
                and number >= nearest - 2
            ):
                between = above[nearest - skipped - 1][:_SHOWN]
                raise FileFormatError(
                    f"{path}: line {nearest} ({between!r}) stands between headings and rows and is neither; correct "
                    "the file"
                )
            break
    units = tuple(unit or unit_in(heading) for unit, heading in zip(units, headings, strict=True))
    return headings, tuple(unit.strip() for unit in units)


def _heading_cells(line: str, layout: _Layout) -> list[str]:
    """Split a line of the header; headings between blanks may hold blanks, as in ``Time (s)  Force (N)``."""
    plain = line.lstrip(f"{_NOTE} ").strip(" ")
    if layout.delimiter != BLANKS:
        cells = cells_of(plain, layout.delimiter)
        n_cells = layout.width + len(layout.left_out)
        return layout.without_empty(
            cells[:-1] if len(cells) == n_cells + 1 and cells[-1].lower() == "comment" else cells
        )
    splits = [re.split(pattern, plain) for pattern in (r"\s+", r"\s{2,}|\t", r"\s+(?![\[(])")]
    cells = next((split for split in splits if len(split) == layout.width), splits[0])
    return [cell.strip('"') for cell in cells if cell]


def _are_units(row: Sequence[str], width: int) -> bool:
    """Return whether a line below the headings holds their units: at most half of its cells are anything else."""
    return len(row) == width and sum(not is_unit(cell.strip("[]()")) for cell in row) <= len(row) / 2


def _account(lines: Sequence[str], first: int, skipped: int, n_rows: int, layout: _Layout) -> str:
    """Say which lines were read, and which were not and why."""
    text = f"{counted(n_rows, 'row')} read from lines {first + 1} to {len(lines)}"
    n_passed = len(lines) - first - n_rows
    if n_passed:
        place = next(k for k, line in enumerate(islice(lines, first, None), first + 1) if not line or line[0] == "#")
        text += f"; {n_passed} blank or # among them passed over, the first in line {place}"
    if layout.left_out:
        text += f"; columns without numbers left out: {', '.join(str(k + 1) for k in sorted(layout.left_out))}"
    if skipped:
        dropped = sum(layout.is_row(line) for line in lines[:skipped])
        rows = f", {dropped} of them rows of numbers" if dropped else ""
        text += f"; {counted(skipped, 'line')} left out by skip_lines{rows}"
    return text
