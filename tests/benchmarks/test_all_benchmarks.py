"""One command runs the benchmarks; what fails or takes too long is told in its page, and by its exit code."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # benchmarks are no installed package

from benchmarks.__main__ import BENCHMARKS, Benchmark, machine, run  # noqa: E402


def test_every_benchmark_of_the_list_is_there_and_can_be_typed() -> None:
    for each in BENCHMARKS:
        text = (ROOT / "benchmarks" / f"{each.name}.py").read_text(encoding="utf-8")
        assert "def main(" in text
        assert each.command == " ".join(["python -m", f"benchmarks.{each.name}", *each.options])
    listed = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--list"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert [line.split()[0] for line in listed.stdout.splitlines()] == [each.name for each in BENCHMARKS]


def test_a_failure_and_a_benchmark_that_takes_too_long_are_told() -> None:
    printed, ending, _ = run(Benchmark("no_such_benchmark", "?", ""))
    assert printed == ""
    assert ending.startswith("ended with code 1: ")
    assert "no_such_benchmark" in ending
    assert run(Benchmark("accuracy", "?", ""), limit=0.05)[1] == "stopped after 0 s"


def test_the_machine_is_told_without_its_name() -> None:
    import platform

    stated = dict(machine())
    assert {"date", "millfrf", "processor", "memory", "Python", "load before"} <= set(stated)
    assert platform.node() not in " ".join(stated.values())
