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
USAGE = """usage: python3 run.py JOB
  demo [--out DIR ...]            the demonstration, from recordings to stability lobes
  test [--all] [PYTEST OPTIONS]   the tests; --all: the long ones as well
  docs [SPHINX OPTIONS]           the site
  lint                            ruff, mypy and import-linter
  release [DIR]                   the distributions, checked"""
EXTRAS = {"demo": "", "test": "[test]", "docs": "[docs]", "lint": "[lint]"}
SITE = PROJECT / "docs" / "_build"
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def program(name: str) -> str:
    """Path of a program inside the virtual environment, on any system."""
    folder, suffix = ("Scripts", ".exe") if os.name == "nt" else ("bin", "")
    return str(ENVIRONMENT / folder / f"{name}{suffix}")


def install(extras: str) -> None:
    """Make the virtual environment if it is not there, and install the project with some extras into it."""
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


def run_tests(options: list[str]) -> int:
    """Run the tests on two cores. One thread a process for linear algebra: two processes fill two cores."""
    chosen = ["--long", "all"] if "--all" in options else [] if "--long" in options else ["--long", "none"]
    rest = [option for option in options if option != "--all"]
    marked = [] if "-m" in rest else ["-m", "not slow"]
    command = [program("python"), "-m", "pytest", "-n", "2", "--dist", "worksteal", *marked, *chosen, *rest]
    return subprocess.run(command, cwd=PROJECT, env=os.environ | ONE_THREAD).returncode


def lint() -> int:
    """Run all linters, whatever the first ones say."""
    checks = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"], ["lint-imports"])
    return max([subprocess.run([program(name), *options], cwd=PROJECT).returncode for name, *options in checks])


def run(arguments: list[str]) -> int:
    """Install what the job needs and do it; returns the exit code."""
    job, *rest = arguments or [""]
    if job == "release":
        return subprocess.run([sys.executable, str(PROJECT / ".ci" / "release.py"), *rest]).returncode
    if job not in EXTRAS:
        print(USAGE)
        return 2
    install(EXTRAS[job])
    if job == "demo":
        return subprocess.run([program("millfrf"), "demo", *rest]).returncode
    return build_site(rest) if job == "docs" else run_tests(rest) if job == "test" else lint()


if __name__ == "__main__":
    if sys.version_info < (3, 11):
        sys.exit(f"millfrf needs Python 3.11 or newer; this is {sys.version.split()[0]}")
    try:
        sys.exit(run(sys.argv[1:]))
    except subprocess.CalledProcessError as failure:
        sys.exit(f"installation failed with exit code {failure.returncode}; see the lines above")
