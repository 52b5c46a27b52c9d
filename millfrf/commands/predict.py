"""`millfrf predict`: the responses a model gives for recorded forces."""

from pathlib import Path
from typing import Annotated

import typer

from ..options import Output, check_output


def predict(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="Model, with or without terms of physics.")],
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording whose forces are used.")],
    out: Output,
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
) -> None:
    """Simulate a recording's forces through a model; print how far measured responses are off."""
    from ..chain.predict import predict_file

    check_output(out, (".h5",), [recording])
    for line in predict_file(model, recording, out, stream=stream):
        typer.echo(line, err=line.startswith("warning: "))
