"""The commands of `millfrf robot`, one a file. Their modules import nothing heavy, so that `--help` is quick."""

from collections.abc import Callable

import typer

from ...usage import framed
from .compensate import compensate
from .deviation import deviation
from .diagnose import diagnose
from .frf import frf
from .identify import identify
from .learn import learn
from .list_robots import list_robots
from .lobes import lobes
from .map_command import map_command
from .modes import modes
from .path_command import path_command
from .show import show
from .stiffness import stiffness
from .update import update

COMMANDS: dict[str, Callable[..., None]] = {
    "diagnose": diagnose,
    "update": update,
    "list": list_robots,
    "show": show,
    "modes": modes,
    "frf": frf,
    "stiffness": stiffness,
    "deviation": deviation,
    "lobes": lobes,
    "map": map_command,
    "compensate": compensate,
    "learn": learn,
    "identify": identify,
    "path": path_command,
}
"""By name, in the order in which `--help` lists them."""

robot_app = typer.Typer(
    name="robot",
    help="Robot models as data: a posture gives modes, FRF, stiffness, deviation and stability.",
    add_completion=False,
    rich_markup_mode=None,
)
for _name, _function in COMMANDS.items():
    robot_app.command(_name)(framed(f"robot {_name}", _function))

__all__ = ["robot_app"]
