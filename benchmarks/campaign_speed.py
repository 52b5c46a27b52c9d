"""What a campaign costs beside its jobs: overhead and memory of 10^4 tasks, speed-up on two workers, 10^5 recordings.

Run it: `python benchmarks/campaign_speed.py overhead [TASKS] [WORKERS]`, or `python benchmarks/campaign_speed.py
speed-up FOLDER [POSES]`. The second makes a small simulated campaign in FOLDER and diagnoses its poses on one worker
and on two. Beside the time by the clock it gives processor times: on a machine that others use too, the speed-up is
that of the processor time of one worker over that of the busier of two. docs/campaigns.md has the tables.
"""

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / part) for part in ("", "tests/millfrf/campaign")]

WORKERS_THEN, RECORDINGS_THEN = 100, 100_000
PRICE = 0.05
"""Euro for an hour of one core, about what clouds ask without a contract in 2026."""


def overhead(tasks: int = 10_000, workers: int = 2) -> None:
    """Print what tasks cost that have nothing to do."""
    from overhead_of_tasks import overhead_of

    with tempfile.TemporaryDirectory() as folder:
        single = overhead_of(tasks, workers, Path(folder))
    print(f"{single.tasks} tasks with nothing to do on {workers} workers: {sorted(single.statuses)}")
    print(f"by the clock          {1e3 * single.seconds / single.tasks:8.2f} ms a task ({single.seconds:.1f} s)")
    print(f"scheduler's processor {1e3 * single.scheduler_seconds / single.tasks:8.2f} ms a task")
    print(f"workers' processor    {1e3 * single.worker_seconds / single.tasks:8.2f} ms a task")
    print(
        f"memory: scheduler {single.scheduler_bytes / 1e6:.0f} MB, a worker {single.worker_bytes / 1e6:.0f} MB at most"
    )


def watched(command: list[str]) -> tuple[float, dict[int, float]]:
    """Run a command; its time by the clock, and processor seconds of it and of each process below it."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    used: dict[int, float] = {}

    def watch() -> None:
        root = psutil.Process(run.pid)
        while run.poll() is None:
            try:
                for each in [root, *root.children(recursive=True)]:
                    times = each.cpu_times()
                    used[each.pid] = times.user + times.system
            except psutil.Error:
                pass
            time.sleep(0.2)

    begin = time.perf_counter()
    watcher = threading.Thread(target=watch)
    watcher.start()
    code = run.wait()
    seconds = time.perf_counter() - begin
    watcher.join()
    if code:
        raise SystemExit(f"{' '.join(command)}: exit code {code}")
    return seconds, used


def speed_up(folder: str, poses: int = 8) -> None:
    """Diagnose all poses of a small campaign on one worker and on two."""
    made = Path(folder) / "campaign"
    program = [sys.executable, "-m", "millfrf"]
    if not made.is_dir():
        asked = ["--recordings", str(6 * poses), "--poses", str(poses)]
        subprocess.run(
            [*program, "demo", "--campaign", "--out", str(made), *asked],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            check=True,
        )
    text = (made / "campaign.toml").read_text(encoding="utf-8")
    for job in ("fit", "calibrate", "lobes", "learn", "report"):
        text = re.sub(rf"^\[{job}\]\n(?:[^\[\n].*\n|\n)*", "", text, flags=re.MULTILINE)
    (made / "diagnoses.toml").write_text(text, encoding="utf-8")
    busiest = {}
    for workers in (1, 2):
        out = Path(folder) / f"on_{workers}_{time.time_ns()}"
        command = [*program, "campaign", str(made / "diagnoses.toml"), "--workers", str(workers), "--out", str(out)]
        seconds, used = watched(command)
        most = sorted(used.values(), reverse=True)[:workers]
        busiest[workers] = most[0], seconds
        tasks = _seconds_of_tasks(out, "diagnose")
        print(
            f"{workers} workers: {seconds:.1f} s by the clock; processor: workers "
            f"{[round(each, 1) for each in most]} s, "
            f"all {sum(used.values()):.1f} s; {len(tasks)} diagnoses, {min(tasks):.1f} to {max(tasks):.1f} s each"
        )
    by_clock, by_processor = (busiest[1][k] / busiest[2][k] for k in (1, 0))
    print(f"speed-up by the clock {by_clock:.2f}, by processor time {by_processor:.2f}")


def _seconds_of_tasks(out: Path, kind: str) -> list[float]:
    logs = "\n".join(path.read_text(encoding="utf-8") for path in (out / "logs" / kind).glob("*.log"))
    return [float(each) for each in re.findall(r"process \d+, ([\d.]+) s: done", logs)]


def projected(seconds_a_recording: float, tasks_a_recording: float, scheduler_seconds_a_task: float) -> str:
    """How long 10^5 recordings take on 100 workers, and what they cost.

    Workers share the processor time of all jobs; the scheduler passes on one task after the other. The longer of the
    two is the time.
    """
    work = RECORDINGS_THEN * seconds_a_recording / WORKERS_THEN
    passing = RECORDINGS_THEN * tasks_a_recording * scheduler_seconds_a_task
    hours = max(work, passing) / 3600
    cost = hours * (WORKERS_THEN + 1) * PRICE
    return f"{hours:.2f} h (jobs {work / 3600:.2f} h, scheduler {passing / 3600:.2f} h), {cost:.0f} euro"


if __name__ == "__main__":
    if sys.argv[1] == "overhead":
        overhead(*(int(word) for word in sys.argv[2:]))
    elif sys.argv[1] == "projected":
        print(projected(*(float(word) for word in sys.argv[2:])))
    else:
        speed_up(sys.argv[2], *(int(word) for word in sys.argv[3:]))
