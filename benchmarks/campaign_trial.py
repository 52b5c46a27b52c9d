"""A simulated campaign through everything: workers killed, the run killed, what is hidden found, and the same bytes.

Run it: `python benchmarks/campaign_trial.py FOLDER [POSES] [SEED] [WORKERS] [EACH] [JOBS]`, such as `trial 20 0 4 10`.
It makes a campaign of EACH recordings a pose, runs it undisturbed on two workers, then on WORKERS with one killed in
mid-run, then kills a whole run and resumes it. It prints what was found of what is concealed, and how many files
differ: none should. JOBS names tables of campaign.toml that are left out, separated by commas.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[1]
KEPT = ("results", "summary", "failures.csv")
"""What must be equal byte by byte."""


def _environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}


def started(campaign: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    """A run of the campaign in a process group of its own."""
    command = [sys.executable, "-m", "millfrf", "campaign", str(campaign), "--out", str(out)]
    log = out.with_suffix(".log").open("ab")
    return subprocess.Popen(
        [*command, "--workers", str(workers)], env=_environment(), stdout=log, stderr=log, start_new_session=True
    )


def results(out: Path) -> int:
    """Number of results that are in the store."""
    return sum(1 for path in (out / "results").glob("*/*") if path.is_dir())


def wait_for(run: subprocess.Popen[bytes], out: Path, count: int) -> bool:
    """Wait until so many results are there; False where the run ended before."""
    while run.poll() is None:
        if results(out) >= count:
            return True
        time.sleep(0.2)
    return False


def workers_of(run: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """Worker processes of a run: those of its descendants that compute."""
    children = psutil.Process(run.pid).children(recursive=True)
    return [each for each in children if "resource_tracker" not in " ".join(each.cmdline())]


def files_of(out: Path) -> dict[str, bytes]:
    """Every file that must be equal."""
    result = {}
    for name in KEPT:
        for path in sorted([out / name] if (out / name).is_file() else (out / name).rglob("*")):
            if path.is_file():
                result[path.relative_to(out).as_posix()] = path.read_bytes()
    return result


def differing(one: Path, other: Path) -> list[str]:
    """Files of two runs that are not equal."""
    first, second = files_of(one), files_of(other)
    return sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))


def undisturbed(campaign: Path, out: Path, workers: int) -> float:
    """Run to the end; seconds."""
    begin = time.perf_counter()
    code = started(campaign, out, workers).wait()
    print(f"undisturbed on {workers} workers: exit {code}, {time.perf_counter() - begin:.0f} s, {results(out)} results")
    return time.perf_counter() - begin


def with_a_worker_killed(campaign: Path, out: Path, workers: int, at: int) -> None:
    """Kill one worker (SIGKILL) when ``at`` results are there, and let the run go on."""
    run = started(campaign, out, workers)
    if wait_for(run, out, at):
        victim = workers_of(run)[-1]
        victim.kill()
        print(f"killed worker {victim.pid} of {workers} at {results(out)} results")
    print(f"it ended: exit {run.wait()}, {results(out)} results")


def killed_and_resumed(campaign: Path, out: Path, workers: int, at: int) -> None:
    """Kill the whole run (SIGKILL to its group) when ``at`` results are there, and start it anew."""
    run = started(campaign, out, workers)
    if wait_for(run, out, at):
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
        print(f"killed the whole run at {results(out)} results")
    print(f"resumed: exit {started(campaign, out, workers).wait()}, {results(out)} results")


def found_of_hidden(folder: Path, out: Path) -> None:
    """Print whether the drift and the five broken files stand in the summary."""
    truth = json.loads((folder / "concealed.json").read_text(encoding="utf-8"))
    pages = [path for path in sorted(out.rglob("*")) if path.suffix in (".csv", ".html", ".log")]
    stated = "\n".join(path.read_text(encoding="utf-8") for path in pages)
    for each in truth["broken"]:
        name = Path(each["file"]).stem
        lines = [line.strip() for line in stated.splitlines() if name in line]
        shortest = re.sub(r"<[^>]+>", " ", min(lines, key=len)) if lines else "NOT LISTED"
        print(f"{each['fault']:15} {name:16} {shortest[:160]}")
    print(f"drift hidden in {truth['drift']['pose']}, joint {truth['drift']['joint']}")


def main(folder: str, poses: int = 20, seed: int = 0, workers: int = 4, each: int = 10, left_out: str = "") -> None:
    """Run the trial."""
    base = Path(folder)
    base.mkdir(parents=True, exist_ok=True)
    made = base / "campaign"
    if not made.is_dir():
        asked = ["--recordings", str(each * poses), "--poses", str(poses), "--seed", str(seed)]
        command = [sys.executable, "-m", "millfrf", "demo", "--campaign", "--out", str(made), *asked]
        subprocess.run(command, env=_environment(), check=True)
    campaign = made / "trial.toml"
    text = (made / "campaign.toml").read_text(encoding="utf-8")
    for job in filter(None, left_out.split(",")):
        text = re.sub(rf"^\[{job}\]\n(?:[^\[\n].*\n|\n)*", "", text, flags=re.MULTILINE)
    campaign.write_text(text, encoding="utf-8")
    first, second, third = (base / name for name in ("undisturbed", "worker_killed", "resumed"))
    undisturbed(campaign, first, 2)
    with_a_worker_killed(campaign, second, workers, results(first) // 3)
    killed_and_resumed(campaign, third, workers, results(first) // 2)
    for other in (second, third):
        print(f"{other.name}: {len(differing(first, other))} of {len(files_of(first))} files differ")
    found_of_hidden(made, first)


if __name__ == "__main__":
    main(sys.argv[1], *(int(word) for word in sys.argv[2:6]), *sys.argv[6:7])
