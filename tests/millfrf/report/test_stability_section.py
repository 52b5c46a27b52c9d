"""Where two measurements advise differently: the table of speeds."""

from math import pi

import numpy as np

from millfrf.reports.results_page import of_numbers
from millfrf.reports.sections.stability import advice_table, lobes_table
from millfrf.stability import StabilityLobes


def lobes(depth: np.ndarray, rpm: np.ndarray) -> StabilityLobes:
    finite = np.isfinite(depth)
    kinds = tuple("hopf" if value else "none" for value in finite)
    return StabilityLobes(rpm * pi / 30, depth, np.where(finite, 18.0, np.nan), kinds, "zero-order")


def test_ranges_and_worst_speed() -> None:
    rpm = np.arange(600.0, 2001.0, 10)
    base = np.full(len(rpm), 2e-3)
    other = base.copy()
    other[(rpm >= 900) & (rpm <= 1000)] *= 1.3
    other[rpm == 950] *= 1.1
    other[rpm >= 1800] *= 0.8
    other[rpm == 1500] *= 1.05  # too little to count
    table = advice_table(lobes(base, rpm), lobes(other, rpm), "milled", "tapped")
    assert [row[0] for row in table.rows] == ["900 to 1000", "1800 to 2000"]
    assert table.rows[0][1:] == ("950", "2.00", "2.86", "+43 %")
    assert table.rows[1][4] == "-20 %"


def test_same_advice_gives_no_row_and_no_limit_is_said() -> None:
    rpm = np.arange(600.0, 2001.0, 10)
    base = np.full(len(rpm), 2e-3)
    assert advice_table(lobes(base, rpm), lobes(1.05 * base, rpm), "a", "b").rows == ()
    free = np.where(rpm > 1900, np.inf, base)
    [row] = advice_table(lobes(base, rpm), lobes(free, rpm), "a", "b").rows
    assert row[3:] == ("no limit", "no limit")


def test_the_table_of_limits_has_the_lowest_one_and_both_sides_of_each_change() -> None:
    """Twelve even speeds of 141 miss a narrow pocket and the ends of the range without a limit."""
    rpm = np.arange(600.0, 2001.0, 10)
    depth = np.full(len(rpm), 2e-3)
    depth[rpm == 1010] = 1e-3
    depth[(rpm >= 1470) & (rpm <= 1530)] = np.inf
    table = lobes_table({"milled": lobes(depth, rpm)}, {"milled": 0.012})
    rows = {row[0]: row for row in table.rows}
    assert rows["1010"][1] == "1.000"
    assert [rows[speed][1] for speed in ("1460", "1470", "1530", "1540")] == [
        "2.000",
        *["none up to 12 mm"] * 2,
        "2.000",
    ]
    assert list(rows) == sorted(rows, key=float)
    assert of_numbers(table)[1]
    assert "no limit" in {row[1] for row in lobes_table({"milled": lobes(depth, rpm)}, {"milled": 0.0}).rows}


def test_many_changes_of_type_do_not_flood_the_table() -> None:
    rpm = np.arange(600.0, 2001.0, 10)
    table = lobes_table({"milled": lobes(np.where(np.arange(len(rpm)) % 2, np.inf, 2e-3), rpm)}, {"milled": 0.01})
    assert len(table.rows) <= 13
