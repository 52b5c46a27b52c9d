"""Build the distributions and check what is uploaded: `python3 run.py release [DIR]`.

Each step runs in a new virtual environment, which has nothing of this folder. Only the Python that runs it is needed.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import venv
import zipfile
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
PLATFORMS = {
    "Linux": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "macOS": ("macosx_14_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
    "Windows": ("win_amd64",),
}
"""Systems for which all dependencies must come as binary wheels, with the tags that they take."""

TESTED = ("tests/core", "tests/cutting", "tests/estimation", "tests/millfrf/chain")
"""The part of the tests that runs against the installed wheel: it takes files to FRFs, models and lobes."""

OWN_KINDS = {".py", ".pyi", ".toml", ".css", ".js", ".html", ".j2"}


def main(arguments: list[str]) -> int:
    """Build, check, install and test; returns the exit code."""
    out = Path(arguments[0]).resolve() if arguments else PROJECT / "dist"
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        tools = Environment(scratch / "tools")
        tools.pip("build", "twine", "check-wheel-contents", "cffconvert")
        source, wheel = build(tools, scratch / "dist")
        check_files(tools, source, wheel)
        check_wheel(wheel)
        check_platforms(tools, wheel)
        test_wheel(scratch, source, wheel)
        out.mkdir(parents=True, exist_ok=True)
        for one in (source, wheel):
            copy(one, out / one.name)
            print(out / one.name)
    return 0


class Environment:
    """A new virtual environment."""

    def __init__(self, folder: Path) -> None:
        venv.create(folder, with_pip=True)
        self.programs = folder / ("Scripts" if os.name == "nt" else "bin")

    def run(self, *command: str, cwd: Path = PROJECT) -> None:
        """Run a module of it; a failure ends the release."""
        hidden = ("PYTHONPATH", "PYTHONHOME")
        settings = {name: value for name, value in os.environ.items() if name not in hidden}
        subprocess.run([str(self.programs / "python"), "-m", *command], cwd=cwd, check=True, env=settings)

    def pip(self, *packages: str) -> None:
        """Install without building anything but what is pure Python."""
        self.run("pip", "install", "--quiet", "--disable-pip-version-check", *packages)


def copy(source: Path, to: Path) -> None:
    """Copy a file."""
    to.write_bytes(source.read_bytes())


def build(tools: Environment, out: Path) -> tuple[Path, Path]:
    """Source distribution of a clean copy of what git holds, and the wheel that is built from it."""
    say("source distribution and wheel")
    copied = out.parent / "source"
    copied.mkdir()
    files = subprocess.run(["git", "ls-files", "-z"], cwd=PROJECT, capture_output=True, check=True, text=True).stdout
    for name in files.rstrip("\0").split("\0"):
        (copied / name).parent.mkdir(parents=True, exist_ok=True)
        copy(PROJECT / name, copied / name)
    tools.run("build", "--outdir", str(out), str(copied))
    (source,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return source, wheel


def check_files(tools: Environment, source: Path, wheel: Path) -> None:
    """Metadata, description, contents and citation, by the tools of those who made the formats."""
    say("twine, check-wheel-contents, cffconvert")
    tools.run("twine", "check", "--strict", str(source), str(wheel))
    tools.run("check_wheel_contents", "--ignore", "W009", str(wheel))  # W009: several packages, as designed
    subprocess.run([str(tools.programs / "cffconvert"), "--validate", "-i", str(PROJECT / "CITATION.cff")], check=True)


def check_wheel(wheel: Path) -> None:
    """Pure Python, no file of a kind that THIRD_PARTY.md does not name, licences inside."""
    say("the wheel is pure Python and holds its licences")
    if not wheel.name.endswith("-py3-none-any.whl"):
        sys.exit(f"{wheel.name} is not pure Python")
    names = [Path(name) for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/")]
    notes = [name for name in names if ".dist-info" in name.parts[0]]
    strange = sorted(
        str(name) for name in set(names) - set(notes) if name.suffix not in OWN_KINDS and name.name != "py.typed"
    )
    if strange:
        sys.exit(f"the wheel holds files of kinds that THIRD_PARTY.md does not name: {strange}")
    wanted = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["license-files"]
    missing = set(wanted) - {"/".join(name.parts[2:]) for name in notes if name.parts[1] == "licenses"}
    if missing:
        sys.exit(f"the wheel lacks {sorted(missing)}")


def check_platforms(tools: Environment, wheel: Path) -> None:
    """Every dependency comes as a binary wheel: no compiler is needed. Nothing is installed."""
    for system, tags in PLATFORMS.items():
        say(f"dependencies as binary wheels, {system}")
        options = ["--dry-run", "--ignore-installed", "--quiet", "--only-binary", ":all:"]
        options += [word for tag in tags for word in ("--platform", tag)]
        tools.run("pip", "install", *options, "--python-version", "3.12", "--target", "nowhere", str(wheel))


def test_wheel(scratch: Path, source: Path, wheel: Path) -> None:
    """From a folder that has no package: doctests of all packages, and a part of the tests."""
    say("the wheel, installed elsewhere, in an empty folder")
    installed = Environment(scratch / "installed")
    installed.pip("--only-binary", ":all:", f"{wheel}[live,notebook]")
    installed.pip("pytest", "hypothesis", "sdypy-EMA")  # a peer that reads our files
    empty = scratch / "empty"
    empty.mkdir()
    installed.run("millfrf", "--version", cwd=empty)
    packages = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    doctests = ["--doctest-modules", "--import-mode", "importlib", "--pyargs", *packages["root_packages"]]
    installed.run("pytest", "-q", *doctests, cwd=empty)
    with tarfile.open(source) as archive:
        archive.extractall(scratch / "unpacked", filter="data")
    (unpacked,) = (scratch / "unpacked").iterdir()
    for name in ("tests", "docs", "examples", "pyproject.toml"):  # pages and examples are what some tests run
        (unpacked / name).rename(empty / name)
    installed.run("pytest", "-q", "-m", "not slow and not shared_data", *TESTED, cwd=empty)


def say(step: str) -> None:
    """Tell which step begins."""
    print(f"== {step}", flush=True)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except subprocess.CalledProcessError as failure:
        sys.exit(f"not ready for a release: {' '.join(map(str, failure.cmd[2:]))} ended with {failure.returncode}")
