"""The commands of `millfrf new`, one a file."""

from collections.abc import Callable

import typer

from ..usage import framed
from .new_files import new_campaign, new_cut, new_schemas, new_session
from .new_mapping import new_mapping
from .new_robot import new_robot

new_app = typer.Typer(
    name="new",
    help="A commented file to begin with, filled in from what there is.",
    add_completion=False,
    rich_markup_mode=None,
)


@new_app.callback()
def _new() -> None:
    """A commented file to begin with, filled in from what there is."""


COMMANDS: dict[str, Callable[..., None]] = {
    "mapping": new_mapping,
    "cut": new_cut,
    "session": new_session,
    "robot": new_robot,
    "campaign": new_campaign,
    "schemas": new_schemas,
}
"""By name, in the order in which `--help` lists them."""

for _name, _function in COMMANDS.items():
    new_app.command(_name)(framed(f"new {_name}", _function))
