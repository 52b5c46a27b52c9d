"""`cut_text`, `session_text`: templates of files that nothing but the user fills in."""

from collections.abc import Sequence
from typing import Any

from ...toml_files import DescribedTable, TomlFile, described_tables, toml_files
from .questions import Question
from .template import FILL_IN, Row, template


def cut_text(teeth: int | None, diameter: float | None, *, plan: bool) -> str:
    """Text of a cutting file; ``diameter`` in m. With ``plan`` it has the table of a plan, too."""
    given: dict[str, Any] = {}
    if teeth is not None:
        given["teeth"] = teeth
    if diameter is not None:
        given["diameter_m"] = diameter
    given |= _engagement(diameter)
    tables = [*described_tables(_kind("cut")), *(described_tables(_kind("plan")) if plan else ())]
    rows: dict[str, Sequence[Row]] = {"[cutting]": [given], "[plan]": [{}]}
    title = (
        f"A cut: cutter, engagement, force coefficients. Marked {FILL_IN}: what must be given.\n"
        "The engagement is start_angle_deg and exit_angle_deg, or immersion (with radial_depth_m)."
    )
    return template(title, tables, rows)


def _engagement(diameter: float | None) -> dict[str, Question]:
    """What is asked of the engagement; ``diameter`` in m."""
    half = "diameter_m / 2" if diameter is None else f"{diameter / 2:g}"
    return {
        "start_angle_deg": Question("give this and exit_angle_deg only instead of immersion", open=False),
        "immersion": Question('"up", "down", "central" or "slot"; or both angles above'),
        "radial_depth_m": Question(f"width of cut; half immersion, up or down: {half}; not for a slot or with angles"),
    }


def session_text(driver: str, n_channels: int) -> str:
    """Text of a session file for a device: ``ni``, ``replay`` or ``simulated``."""
    kind = _kind("session")
    tables = [table for table in described_tables(kind) if table.heading != "[device]" or _drives(table, driver)]
    rows: dict[str, Sequence[Row]] = {"": [{}], "[device]": [{"driver": driver}]}
    if driver == "ni":
        rows["[[channels]]"] = [{} for _ in range(n_channels)]
    title = (
        f"A session for: millfrf acquire THIS.toml --out REC.h5. Marked {FILL_IN}: what must be given.\n"
        "Tables that stand as comments are not used; take the # away where the rig has such a device."
    )
    return template(title, tables, rows)


def campaign_text(files: Sequence[str], robot: str | None) -> str:
    """Text of a campaign file for recordings by name, and a robot where its postures matter."""
    rows: dict[str, Sequence[Row]] = {
        "[campaign]": [{} if robot is None else {"robot": robot}],
        "[[recordings]]": [{"files": list(files)}],
        "[sets]": [{}],
        "[fit]": [{}],
        "[report]": [{}],
    }
    title = (
        f"A campaign for: millfrf campaign THIS.toml --dry-run. Marked {FILL_IN}: what must be given.\n"
        "A job is done if its table is there: take the # away from [estimate], [calibrate], [lobes], [diagnose] ..."
    )
    return template(title, described_tables(_kind("campaign")), rows)


def _kind(name: str) -> TomlFile:
    return next(file for file in toml_files() if file.name == name)


def _drives(table: DescribedTable, driver: str) -> bool:
    return any(key.name == "driver" and key.kind == f"`{driver}`" for key in table.keys)
