"""Execution of tasks on Dask workers."""

import asyncio
import logging
import platform
import queue
import tempfile
import time
import uuid
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from millfrf.core import InputError, MillfrfError

from .running import DONE, FAILED, FOREIGN, REFUSED, Ended, Order, run_task
from .store import program_digest, read_outcome

FIRST_WORKER_SECONDS = 30.0  # s; longest wait for the first worker


def seen_by_worker(out: str, mark: str, probe: str, size: int) -> dict[str, Any]:
    """Return the versions of a worker and whether it can use the folders; this function runs in the worker."""
    import distributed

    test_file = Path(out) / f".worker-{uuid.uuid4().hex}"
    try:
        test_file.write_text("", encoding="utf-8")
        test_file.unlink()
        write_error = ""
    except OSError as error:
        write_error = error.strerror or str(error)
    return {
        "host": platform.node(),
        "program": program_digest(),
        "python": platform.python_version(),
        "distributed": distributed.__version__,
        "sees_out": (Path(out) / mark).is_file(),
        "writes": write_error,
        "sees_probe": Path(probe).is_file() and Path(probe).stat().st_size == size,
    }


def check_workers(client: Any, out: Path, probe: Path, address: str | None) -> None:
    """Refuse workers with other versions, several threads, or without access to the folders."""
    place = "the local cluster" if address is None else f"the scheduler at {address}"
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER_SECONDS)
    except TimeoutError as error:
        raise InputError(
            f"{place} has no worker after {FIRST_WORKER_SECONDS:g} s; start some with "
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
        others = f" (and {len(faults) - 1} more workers)" if len(faults) > 1 else ""
        raise InputError(f"{faults[0]}{others}")


def _with_threads(answer: Any, threads: int) -> Any:
    return {**answer, "threads": threads} if isinstance(answer, dict) else answer


def _fault(answer: Any, worker: str, out: Path, probe: Path) -> str:
    """Return the reason why a worker cannot be used; an empty text if it can be used."""
    import distributed

    if isinstance(answer, BaseException):
        return (
            f"worker {worker} cannot run this version of millfrf ({type(answer).__name__}: {answer}); install the "
            "same version there"
        )
    label = f"worker {worker} on {answer['host']}"
    if answer["threads"] != 1:
        return f"{label} has {answer['threads']} threads; start it with --nthreads 1, and more workers instead"
    ours = {"python": platform.python_version(), "distributed": distributed.__version__}
    for name, version in ours.items():
        if answer[name] != version:
            return f"{label} has {name} {answer[name]}, this computer {version}; install equal versions"
    if answer["program"] != program_digest():
        return f"{label} has another version of millfrf or of its libraries; install equal versions and restart it"
    if not answer["sees_out"]:
        return f"{label} does not see the folder {out}; put --out on a disk that all machines share under one name"
    if answer["writes"]:
        return f"{label} cannot write into {out}: {answer['writes']}; give it the right to"
    if not answer["sees_probe"]:
        return f"{label} does not see {probe}; put recordings on a disk that all machines share under one name"
    return ""


CONNECT_SECONDS = 15.0  # s; longest wait for the scheduler
ASK_SECONDS = 2.0  # s between two queries of the number of workers

# Dask gives a task up once its worker has died four times
SETTINGS = {"distributed.scheduler.allowed-failures": 3}


class OnDask:
    """Executor with a Dask client; results stay in files, workers return only :class:`Ended`.

    A worker that joins late with another version of the program gets no more tasks; its tasks go to other workers.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._ended: queue.Queue[Any] = queue.Queue()
        self._running: dict[Any, Order] = {}
        self._number = 0
        self._workers: list[str] = []
        self._asked = -ASK_SECONDS
        self._foreign: set[str] = set()

    @property
    def n_workers(self) -> int:
        """Number of connected workers, updated every :data:`ASK_SECONDS`."""
        now = time.monotonic()
        if now - self._asked > ASK_SECONDS:
            self._asked = now
            with _scheduler_errors():
                self._workers = [worker for worker in self._client.nthreads() if worker not in self._foreign]
        return len(self._workers)

    def submit(self, order: Order) -> None:
        self._number += 1
        name = f"{order.identity.partition(':')[0]}-{order.key[:16]}-{self._number}"
        chosen = self._workers if self._foreign else None
        with _scheduler_errors():
            # without other workers as a last choice, a task would wait for ever if all chosen workers died
            future = self._client.submit(
                run_on_worker, order, key=name, pure=False, workers=chosen, allow_other_workers=chosen is not None
            )
        self._running[future] = order
        future.add_done_callback(self._ended.put)

    def next_ended(self, seconds: float) -> Ended | None:
        try:
            future = self._ended.get(timeout=seconds)
        except queue.Empty:
            if self._client.status not in ("running", "connecting"):
                raise MillfrfError(GONE) from None
            return None
        order = self._running.pop(future)
        if future.status not in ("finished", "error"):
            raise MillfrfError(GONE)
        try:
            with _scheduler_errors():
                ended, worker = future.result()
        except MillfrfError:
            raise
        except Exception as error:  # raised by Dask: run_task raises nothing
            return _given_up(order, error)
        return self._resubmit(order, ended, worker) if ended.status == FOREIGN else ended

    def _resubmit(self, order: Order, ended: Ended, worker: str) -> Ended | None:
        """Submit a task again that a worker with another version returned; without another worker the task fails."""
        self._foreign.add(worker)
        self._asked = -ASK_SECONDS
        if self.n_workers:
            self.submit(order)
            return None
        return replace(ended, status=FAILED)

    def close(self) -> None:
        if self._running and self._client.status == "running":
            with suppress(OSError, TimeoutError):
                self._client.cancel(list(self._running), force=True)


@contextmanager
def _scheduler_errors() -> Iterator[None]:
    """Convert every error that follows from a lost connection to the scheduler into one message."""
    try:
        yield
    except (OSError, TimeoutError, CancelledError, asyncio.CancelledError) as error:
        raise MillfrfError(GONE) from error


def _given_up(order: Order, error: Exception) -> Ended:
    """Return the outcome of a task whose workers died; a worker may have stored the result before it died."""
    outcome = read_outcome(Path(order.out), order.identity, order.key)
    if outcome is not None:
        return Ended(order.identity, DONE if outcome.done else REFUSED, outcome.reason, 0.0)
    died = type(error).__name__ == "KilledWorker"
    reason = "its worker died four times while it ran" if died else f"{type(error).__name__}: {error}"
    return Ended(order.identity, FAILED, " ".join(reason.split())[:300], 0.0)


def run_on_worker(order: Order) -> tuple[Ended, str]:
    """Run a task in a worker; also return the address of the worker."""
    from distributed import get_worker

    return run_task(order), get_worker().address


GONE = "the scheduler is gone; results so far are kept: start it, and run the same command again"


@contextmanager
def dask_executor(address: str | None, workers: int, out: Path, probe: Path) -> Iterator[OnDask]:
    """Open an executor on a scheduler, or on a new local cluster if ``address`` is None."""
    dask, distributed = _library()
    with (
        tempfile.TemporaryDirectory(prefix="millfrf-dask-") as scratch,
        dask.config.set({**SETTINGS, "temporary-directory": scratch}),
        _silent(),
    ):
        cluster = None if address is not None else _cluster(distributed, workers, scratch)
        try:
            client = _client(distributed, address if cluster is None else cluster)
            try:
                with _scheduler_errors():
                    check_workers(client, out, probe, address)
                executor = OnDask(client)
                try:
                    yield executor
                finally:
                    executor.close()
            finally:
                with suppress(OSError, TimeoutError):
                    client.close(timeout=5)
        finally:
            if cluster is not None:
                cluster.close(timeout=10)


def _library() -> tuple[Any, Any]:
    try:
        import dask
        import distributed
    except ImportError as error:
        raise InputError(
            "several workers need Dask, which is not installed: pip install 'millfrf[cluster]', or give --workers 0"
        ) from error
    return dask, distributed


@contextmanager
def _silent() -> Iterator[None]:
    """Suppress the log messages and warnings of Dask; each of its loggers has its own level."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module=r"distributed\..*")
            yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


def _cluster(distributed: Any, workers: int, scratch: str) -> Any:
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        memory_limit=0,  # jobs check their memory before they start
        local_directory=scratch,
        silence_logs=logging.CRITICAL,
    )


def _client(distributed: Any, address: Any) -> Any:
    try:
        return distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no scheduler answers at {address} within {CONNECT_SECONDS:g} s; check the address and start one with "
            "'dask scheduler'"
        ) from error
