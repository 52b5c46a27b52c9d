"""The commands of `millfrf new`, one a file."""

import typer

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


new_app.command("mapping")(new_mapping)
new_app.command("cut")(new_cut)
new_app.command("session")(new_session)
new_app.command("robot")(new_robot)
new_app.command("campaign")(new_campaign)
new_app.command("schemas")(new_schemas)
