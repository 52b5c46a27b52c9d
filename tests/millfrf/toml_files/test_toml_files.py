"""Each key of each TOML file is described, and the schemas for editors take what the commands take."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from millfrf.core.described_tables import TomlFile, described_tables, json_schema, keys_of, schemas_in
from millfrf.new.templates import toml_files

ROOT = Path(__file__).resolve().parents[3]
FILES = {file.name: file for file in toml_files()}
SHIPPED = {
    "examples/session.toml": "session",
    "examples/plan.toml": "plan",
    "examples/fsm_mapping.toml": "mapping",
    **{
        str(path.relative_to(ROOT)): f"robot-{tomllib.loads(path.read_text(encoding='utf-8'))['robot']['kind']}"
        for path in sorted((ROOT / "millfrf" / "robot_model" / "robots").glob("*.toml"))
    },
}
CUT = {"teeth": 2, "diameter_m": 0.0127, "ktc_pa": 119e6, "krc": 0.17, "start_angle_deg": 90.0, "exit_angle_deg": 180.0}


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_every_key_is_described_by_the_docstring_of_its_table(file: TomlFile) -> None:
    for schema in schemas_in(file.schema):
        texts, keys = keys_of(schema), set(schema.model_fields)
        assert keys == set(texts), f"{schema.__module__}.{schema.__name__}: {keys ^ set(texts)}"
        unsaid = [name for name, text in texts.items() if len(text.text) < 10]
        assert not unsaid, f"{schema.__name__}: {unsaid}"


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_names_with_a_unit_have_it_in_the_description(file: TomlFile) -> None:
    endings = {
        "_n_per_m": "N/m",
        "_ns_per_m": "N s/m",
        "_hz": "Hz",
        "_m": "m",
        "_s": "s",
        "_deg": "deg",
        "_kg": "kg",
        "_pa": "Pa",
    }
    for table in described_tables(file):
        for key in table.keys:
            unit = next((unit for end, unit in endings.items() if key.name.endswith(end)), "")
            if unit:
                assert key.unit.startswith(unit), f"{table.heading} {key.name}: {key.unit!r}"


@pytest.mark.parametrize("path", SHIPPED)
def test_shipped_files_satisfy_their_schema(path: str) -> None:
    content = tomllib.loads((ROOT / path).read_text(encoding="utf-8"))
    _validator(SHIPPED[path]).validate(content)


def test_a_schema_refuses_what_the_command_refuses() -> None:
    check = _validator("cut")
    check.validate({"cutting": CUT})
    assert not check.is_valid({"cutting": CUT | {"diameter_mm": 12.7}})
    assert not check.is_valid({"cutting": CUT | {"teeth": "two"}})
    assert not check.is_valid({"cutting": {name: value for name, value in CUT.items() if name != "ktc_pa"}})
    assert not check.is_valid({})


def test_a_schema_tells_meaning_and_unit_at_the_key() -> None:
    properties: dict[str, Any] = json_schema(FILES["cut"])["properties"]["cutting"]["properties"]
    assert properties["diameter_m"]["description"] == "Diameter of the cutter, above 0. [m]"
    assert properties["edge_angle_deg"]["default"] == 90.0


def test_tables_stand_under_the_heading_that_the_file_has() -> None:
    headings = [table.heading for table in described_tables(FILES["session"])]
    assert {"", "[device]", "[live]", "[[channels]]", "[[can]]", "[[can.signals]]", "[[amplifier.check]]"} <= set(
        headings
    )
    assert headings.count("[device]") == 3  # one a driver


def _validator(name: str) -> Draft202012Validator:
    schema = json_schema(FILES[name])
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)
