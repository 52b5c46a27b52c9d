"""Workers are asked before they get work: the same program, and the same folders as here."""

import platform
import uuid
from pathlib import Path
from typing import Any

from millfrf.core import InputError

from .same_program import program_digest

FIRST_WORKER_SECONDS = 30.0
"""How long the first worker is waited for."""


def seen_by_worker(out: str, mark: str, probe: str, size: int) -> dict[str, Any]:
    """What a worker says of itself; runs in the worker."""
    import distributed

    written = Path(out) / f".worker-{uuid.uuid4().hex}"
    try:
        written.write_text("", encoding="utf-8")
        written.unlink()
        writes = ""
    except OSError as error:
        writes = error.strerror or str(error)
    return {
        "host": platform.node(),
        "program": program_digest(),
        "python": platform.python_version(),
        "distributed": distributed.__version__,
        "sees_out": (Path(out) / mark).is_file(),
        "writes": writes,
        "sees_probe": Path(probe).is_file() and Path(probe).stat().st_size == size,
    }


def check_workers(client: Any, out: Path, probe: Path, address: str | None) -> None:
    """Refuse workers that would give other results, or none.

    Raises
    ------
    InputError
        No worker, one of another version, or one that does not see the folders; one line for all of them.
    """
    where = "the local cluster" if address is None else f"the scheduler at {address}"
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER_SECONDS)
    except TimeoutError as error:
        raise InputError(
            f"{where} has no worker after {FIRST_WORKER_SECONDS:g} s; start some with "
            f"'dask worker {address} --nthreads 1'"
        ) from error
    mark = out / f".seen-{uuid.uuid4().hex}"
    mark.write_text("", encoding="utf-8")
    try:
        size = probe.stat().st_size
        answers = client.run(seen_by_worker, str(out), mark.name, str(probe), size, on_error="return")
    finally:
        mark.unlink()
    threads = client.nthreads()
    answers = {worker: _with_threads(answer, threads.get(worker, 1)) for worker, answer in answers.items()}
    faults = [fault for worker, answer in sorted(answers.items()) if (fault := _fault(answer, worker, out, probe))]
    if faults:
        more = f" (and {len(faults) - 1} more workers)" if len(faults) > 1 else ""
        raise InputError(f"{faults[0]}{more}")


def _with_threads(answer: Any, threads: int) -> Any:
    return {**answer, "threads": threads} if isinstance(answer, dict) else answer


def _fault(answer: Any, worker: str, out: Path, probe: Path) -> str:
    """What is wrong with one worker; empty: nothing."""
    import distributed

    if isinstance(answer, BaseException):
        return (
            f"worker {worker} cannot run this version of millfrf ({type(answer).__name__}: {answer}); install the "
            "same version there"
        )
    named = f"worker {worker} on {answer['host']}"
    if answer["threads"] != 1:
        return f"{named} has {answer['threads']} threads; start it with --nthreads 1, and more workers instead"
    ours = {"python": platform.python_version(), "distributed": distributed.__version__}
    for name, version in ours.items():
        if answer[name] != version:
            return f"{named} has {name} {answer[name]}, this computer {version}; install equal versions"
    if answer["program"] != program_digest():
        return f"{named} has another version of millfrf or of its libraries; install equal versions and restart it"
    if not answer["sees_out"]:
        return f"{named} does not see the folder {out}; put --out on a disk that all machines share under one name"
    if answer["writes"]:
        return f"{named} cannot write into {out}: {answer['writes']}; give it the right to"
    if not answer["sees_probe"]:
        return f"{named} does not see {probe}; put recordings on a disk that all machines share under one name"
    return ""
