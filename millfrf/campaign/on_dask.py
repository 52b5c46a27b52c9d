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


CONNECT_SECONDS = 15.0
"""How long a scheduler, and then its first worker, is waited for."""

ASK_SECONDS = 2.0
"""Time between two questions for the number of workers."""

SETTINGS = {"distributed.scheduler.allowed-failures": 3}
"""Dask's settings: a task whose worker has died four times is given up."""


class OnDask:
    """Submits orders to a Dask client; results and arrays stay in files, only :class:`Ended` comes back.

    A worker that joined late with another version of the program gets no more work; what it was given goes elsewhere.
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
        """Number of workers that are there now, asked for now and then.

        Raises
        ------
        MillfrfError
            The scheduler is gone.
        """
        now = time.monotonic()
        if now - self._asked > ASK_SECONDS:
            self._asked = now
            with _telling_of_the_end():
                self._workers = [one for one in self._client.nthreads() if one not in self._foreign]
        return len(self._workers)

    def submit(self, order: Order) -> None:
        """Take an order."""
        self._number += 1
        name = f"{order.identity.partition(':')[0]}-{order.key[:16]}-{self._number}"
        chosen = self._workers if self._foreign else None
        with _telling_of_the_end():
            # others than the chosen come last: where these have died an order would else wait for ever
            future = self._client.submit(
                run_on_worker, order, key=name, pure=False, workers=chosen, allow_other_workers=chosen is not None
            )
        self._running[future] = order
        future.add_done_callback(self._ended.put)

    def next_ended(self, seconds: float) -> Ended | None:
        """How the next task ended.

        Raises
        ------
        MillfrfError
            The scheduler is gone.
        """
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
            with _telling_of_the_end():
                ended, worker = future.result()
        except MillfrfError:
            raise
        except Exception as error:  # of Dask: a job raises nothing
            return _given_up(order, error)
        return self._elsewhere(order, ended, worker) if ended.status == FOREIGN else ended

    def _elsewhere(self, order: Order, ended: Ended, worker: str) -> Ended | None:
        """Give an order of a worker of another version to the others; it has failed where there are none."""
        self._foreign.add(worker)
        self._asked = -ASK_SECONDS
        if self.n_workers:
            self.submit(order)
            return None
        return replace(ended, status=FAILED)

    def close(self) -> None:
        """Give up what has not begun."""
        if self._running and self._client.status == "running":
            with suppress(OSError, TimeoutError):
                self._client.cancel(list(self._running), force=True)


@contextmanager
def _telling_of_the_end() -> Iterator[None]:
    """Say in one line that the scheduler is gone, however Dask's client notices it."""
    try:
        yield
    except (OSError, TimeoutError, CancelledError, asyncio.CancelledError) as error:
        raise MillfrfError(GONE) from error


def _given_up(order: Order, error: Exception) -> Ended:
    """What became of a task whose workers died: it may have stored its result before."""
    found = read_outcome(Path(order.out), order.identity, order.key)
    if found is not None:
        return Ended(order.identity, DONE if found.done else REFUSED, found.reason, 0.0)
    died = type(error).__name__ == "KilledWorker"
    reason = "its worker died four times while it ran" if died else f"{type(error).__name__}: {error}"
    return Ended(order.identity, FAILED, " ".join(reason.split())[:300], 0.0)


def run_on_worker(order: Order) -> tuple[Ended, str]:
    """Run a task in a worker; how it ended, and the worker's address."""
    from distributed import get_worker

    return run_task(order), get_worker().address


GONE = "the scheduler is gone; results so far are kept: start it, and run the same command again"


@contextmanager
def dask_executor(address: str | None, workers: int, out: Path, probe: Path) -> Iterator[OnDask]:
    """An executor on a scheduler by its address, or on a cluster of worker processes that is made here.

    Parameters
    ----------
    address
        Address of a scheduler such as ``tcp://10.0.0.5:8786``; None: a cluster on this machine.
    workers
        Number of worker processes of that cluster.
    out
        Folder of results, which all workers must see.
    probe
        A file of the campaign that all workers must see.

    Raises
    ------
    InputError
        Dask is missing, no scheduler answers, or workers that cannot be used.
    """
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
                with _telling_of_the_end():
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
    """Keep Dask's own words off the terminal; each of its loggers has a level of its own."""
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
        memory_limit=0,  # what a job may take is judged before it starts
        local_directory=scratch,
        silence_logs=logging.CRITICAL,
    )


def _client(distributed: Any, where: Any) -> Any:
    """A client of a scheduler.

    Raises
    ------
    InputError
        Nobody answers there.
    """
    try:
        return distributed.Client(where, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no scheduler answers at {where} within {CONNECT_SECONDS:g} s; check the address and start one with "
            "'dask scheduler'"
        ) from error
