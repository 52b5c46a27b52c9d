"""The page of one kind of TOML file: its tables, each key with type, unit, default and meaning."""

from millfrf.core.described_tables import DescribedKey, TomlFile, described_tables


def file_page(file: TomlFile) -> str:
    """MyST text of the page."""
    readers = ", ".join(f"`millfrf {name}`" for name in file.read_by)
    lines = [f"# {file.name}: {file.title}", "", f"Read by {readers}.", ""]
    for table in described_tables(file):
        lines += [f"## `{table.heading}`" if table.heading else "## Keys of the file", "", _text(table.text), ""]
        lines += ["| key | takes | unit | default | |", "|---|---|---|---|---|"]
        lines += [_row(key) for key in table.keys]
        lines.append("")
    return "\n".join(lines)


def _row(key: DescribedKey) -> str:
    default = "**needed**" if key.default is None else f"`{key.default}`" if key.default else ""
    return f"| `{key.name}` | {_text(key.kind)} | {_text(key.unit)} | {default} | {_text(key.text)} |"


def _text(text: str) -> str:
    return text.replace("``", "`").replace("|", "\\|").replace("*", "\\*")
