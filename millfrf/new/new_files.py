"""`millfrf new cut`, `session`, `campaign`, `schemas`: commented files to begin with, and schemas for editors."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say

Out = Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="File to write.")]


class Driver(StrEnum):
    """Device that samples."""

    NI = "ni"
    REPLAY = "replay"
    SIMULATED = "simulated"


def new_cut(
    out: Out,
    teeth: Annotated[int | None, typer.Option("--teeth", metavar="N", help="Number of cutting edges.")] = None,
    diameter: Annotated[
        float | None, typer.Option("--diameter", metavar="M", help="Diameter of the cutter, m.")
    ] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Add the table of a plan of speed sweeps.")] = False,
) -> None:
    """Write a commented cutting file; what only you know is left out, and lobes name it as missing."""
    from .templates import cut_text, write_new

    write_new(out, cut_text(teeth, diameter, plan=plan))
    say(f"wrote {out}; fill in what is marked FILL IN, then: millfrf lobes MODEL.json --cutting {out} ...")


def new_session(
    out: Out,
    driver: Annotated[Driver, typer.Option("--driver", help="Device that samples.")] = Driver.NI,
    channels: Annotated[
        int, typer.Option("--channels", metavar="N", min=1, max=256, help="Number of inputs to describe.")
    ] = 6,
) -> None:
    """Write a commented session file for `millfrf acquire`."""
    from .templates import session_text, write_new

    write_new(out, session_text(driver.value, channels))
    say(f"wrote {out}; fill in what is marked FILL IN, then: millfrf acquire {out} --check")


def new_campaign(
    files: Annotated[
        list[str], typer.Argument(metavar="REC...", help="Recordings; quoted, with wildcards: 'recordings/*.h5'.")
    ],
    out: Out,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Robot whose postures were measured.")
    ] = None,
) -> None:
    """Write a commented campaign file for `millfrf campaign`."""
    from .templates import campaign_text, write_new

    write_new(out, campaign_text(files, robot))
    say(f"wrote {out}; fill in what is marked FILL IN, then: millfrf campaign {out} --dry-run")


def new_schemas(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the schemas.")],
) -> None:
    """Write a JSON schema of each TOML file, for editors that complete and check keys."""
    from millfrf.core import writing_whole_folder
    from millfrf.core.described_tables import json_schema

    from .toml_files import toml_files

    with writing_whole_folder(out) as folder:
        for file in toml_files():
            text = json.dumps(json_schema(file), indent=2) + "\n"
            (folder / f"{file.name}.schema.json").write_text(text, encoding="utf-8")
    say(f"wrote {len(toml_files())} schemas into {out}; first line of a TOML file: #:schema PATH.schema.json")
