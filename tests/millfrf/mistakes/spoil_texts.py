"""Ways to spoil files of text: cutting files, plans, mappings, tables."""

import shutil
from pathlib import Path


def toml(folder: Path, file: str, *lines: str) -> None:
    """Replace each key's first line, or add it to the last table; ``-key`` takes it out."""
    path = folder / file
    rows = path.read_text(encoding="utf-8").splitlines()
    for line in lines:
        key = line.partition("=")[0].strip()
        result = next((i for i, row in enumerate(rows) if row.partition("=")[0].strip() == key.lstrip("-")), None)
        if key.startswith("-"):
            assert result is not None, key
            del rows[result]
        elif result is None:
            rows.append(line)
        else:
            rows[result] = line
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def cut(folder: Path, *lines: str) -> None:
    """Change the cutting file."""
    toml(folder, "cut.toml", *lines)


def plan(folder: Path, *lines: str) -> None:
    """Change the plan."""
    toml(folder, "plan.toml", *lines)


def renamed(folder: Path, file: str, old: str, new: str) -> None:
    """Write a key otherwise."""
    path = folder / file
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")


def timed(folder: Path, file: str) -> None:
    """Columns after one of times, which the mapping names."""
    path = folder / file
    kept = [
        row for row in path.read_text(encoding="utf-8").splitlines() if not row.startswith(("sample_rate", "column"))
    ]
    content = "\n".join(['time = "t"', *kept]) + "\n"
    for name in ("fx", "ax"):
        content = content.replace(f'name = "{name}"', f'name = "{name}"\ncolumn = "{name}"')
    path.write_text(content, encoding="utf-8")


def text(folder: Path, file: str, content: str) -> None:
    """A file of text, whatever its suffix."""
    (folder / file).write_text(content, encoding="utf-8")


def pdf(folder: Path, file: str) -> None:
    """The head of a PDF, binary."""
    (folder / file).write_bytes(b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n" + bytes(range(256)) * 4)


def empty(folder: Path, file: str) -> None:
    """A file of no bytes."""
    (folder / file).write_bytes(b"")


def subfolder(folder: Path, name: str) -> None:
    """A folder where a file is expected."""
    (folder / name).unlink(missing_ok=True)
    (folder / name).mkdir()


def copy(folder: Path, source: str, target: str) -> None:
    """A copy under another name."""
    shutil.copy(folder / source, folder / target)
