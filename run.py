"""Set the project up on a fresh machine and run it: `python3 run.py demo`, `python3 run.py test`.

Needs Python 3.11 or newer and nothing else. Everything is installed into the folder `.venv` beside
this file, so nothing of the machine's own Python is changed; delete that folder to start afresh.
"""

import os
import subprocess
import sys
import venv
from pathlib import Path

PROJECT = Path(__file__).resolve().parent
ENVIRONMENT = Path(os.environ.get("MILLFRF_VENV", PROJECT / ".venv"))
USAGE = (
    "usage: python3 run.py demo [--out DIR ...] | test [PYTEST OPTIONS] | docs [SPHINX OPTIONS] | lint | release [DIR]"
)
SITE = PROJECT / "docs" / "_build"


def program(name: str) -> str:
    """Path of a program inside the virtual environment, on any system."""
    folder, suffix = ("Scripts", ".exe") if os.name == "nt" else ("bin", "")
    return str(ENVIRONMENT / folder / f"{name}{suffix}")


def install(extras: str) -> None:
    """Make the virtual environment if it is not there, and install the project into it."""
    if not Path(program("python")).exists():
        venv.create(ENVIRONMENT, with_pip=True)
    print(f"installing into {ENVIRONMENT} (a few minutes the first time) ...", flush=True)
    command = [program("python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*command, "--editable", f"{PROJECT}{extras}"], check=True)


def build_site(options: list[str]) -> int:
    """Build the site from the pages, the docstrings and the command line; a warning is a failure."""
    builder = options[options.index("-b") + 1] if "-b" in options[:-1] else "html"
    command = [program("python"), "-m", "sphinx", "-q", "-W", "--keep-going", "-j", "2", "-b", builder, *options]
    code = subprocess.run([*command, "docs", str(SITE / builder)], cwd=PROJECT).returncode
    if code == 0:
        print(f"open {SITE / builder / ('index.html' if builder == 'html' else 'output.txt')}")
    return code


def run(arguments: list[str]) -> int:
    """Install what the job needs and do it; returns the exit code."""
    if not arguments or arguments[0] not in ("demo", "test", "docs", "lint", "release"):
        print(USAGE)
        return 2
    job, *rest = arguments
    if job == "release":
        return subprocess.run([sys.executable, str(PROJECT / ".ci" / "release.py"), *rest]).returncode
    if job == "demo":
        install("")
        return subprocess.run([program("millfrf"), "demo", *rest]).returncode
    install({"lint": "[test,lint]", "docs": "[docs]"}.get(job, "[test]"))
    if job == "docs":
        return build_site(rest)
    if job == "test":
        selection = [] if "-m" in rest else ["-m", "not slow"]
        command = [program("python"), "-m", "pytest", "-n", "2", *selection, *rest]
        return subprocess.run(command, cwd=PROJECT, env={**os.environ, "OMP_NUM_THREADS": "1"}).returncode
    checks = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"], ["lint-imports"])
    codes = [subprocess.run([program(name), *options], cwd=PROJECT).returncode for name, *options in checks]
    return max(codes)


if __name__ == "__main__":
    if sys.version_info < (3, 11):
        sys.exit(f"millfrf needs Python 3.11 or newer; this is {sys.version.split()[0]}")
    try:
        sys.exit(run(sys.argv[1:]))
    except subprocess.CalledProcessError as failure:
        sys.exit(f"installation failed with exit code {failure.returncode}; see the lines above")
