from .described_tables import DescribedKey, DescribedTable, described_tables
from .json_schemas import json_schema
from .known_files import TomlFile, toml_files

__all__ = [
    "DescribedKey",
    "DescribedTable",
    "TomlFile",
    "described_tables",
    "json_schema",
    "toml_files",
]
