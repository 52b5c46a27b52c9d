from .json_schemas import json_schema
from .known_files import TomlFile, toml_files
from .table_keys import DescribedKey, DescribedTable, described_tables

__all__ = [
    "DescribedKey",
    "DescribedTable",
    "TomlFile",
    "described_tables",
    "json_schema",
    "toml_files",
]
