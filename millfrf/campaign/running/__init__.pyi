from .executors import Executor, InThisProcess
from .on_dask import dask_executor
from .one_task import DONE, FAILED, FULL, REFUSED, Ended, Order, log_of, run_task
from .progress_lines import ProgressLines, shown_time
from .rates import Rates, measured_rates, note_time
from .same_program import program_digest
from .store import RESULTS, folder_of, forget, read_outcome
from .task_loop import State, left_to_run, run_tasks

__all__ = [
    "DONE",
    "FAILED",
    "FULL",
    "REFUSED",
    "RESULTS",
    "Ended",
    "Executor",
    "InThisProcess",
    "Order",
    "ProgressLines",
    "Rates",
    "State",
    "dask_executor",
    "folder_of",
    "forget",
    "left_to_run",
    "log_of",
    "measured_rates",
    "note_time",
    "program_digest",
    "read_outcome",
    "run_task",
    "run_tasks",
    "shown_time",
]
