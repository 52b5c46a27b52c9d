"""Lines and files of each room: `python benchmarks/code_size.py` prints the table of docs/architecture.md.

Counted are the Python files and stubs that git knows; `words` are those of the documentation.
"""

import subprocess
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("acquisition", "estimation", "modal_fit", "replay_data", "millfrf")


def room_of(path: Path) -> str:
    """Room of a file: its package at the root, or its folder in `millfrf`."""
    return "/".join(path.parts[:2]) if path.parts[0] == "millfrf" and len(path.parts) > 2 else path.parts[0]


def main() -> None:
    """Print one row for each room, and the totals."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    paths = [Path(name) for name in listed if (ROOT / name).exists()]
    lines: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path in paths:
        if path.parts[0] in PACKAGES and path.suffix in (".py", ".pyi"):
            lines[room_of(path)] += len((ROOT / path).read_text(encoding="utf-8").splitlines())
            files[room_of(path)] += 1
    for room in sorted(lines):
        print(f"| `{room}` | {lines[room]} | {files[room]} |")
    print(f"| all | {lines.total()} | {files.total()} |")
    pages = [path for path in paths if path.suffix == ".md" and path.parts[0] not in ("tests", "benchmarks")]
    print(f"words of documentation: {sum(len((ROOT / page).read_text(encoding='utf-8').split()) for page in pages)}")


if __name__ == "__main__":
    main()
