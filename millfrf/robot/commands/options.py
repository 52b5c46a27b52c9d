"""Arguments and options that several commands of `millfrf robot` share."""

from pathlib import Path
from typing import Annotated

import typer

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file (.toml), or a name that `robot list` shows.")]
Pose = Annotated[
    str | None, typer.Option("--pose", metavar="POSE", help="Posture named in the robot's file; default: its first.")
]
Joints = Annotated[
    str | None,
    typer.Option("--joints", metavar="V,V,...", help="Driven joints: degrees; metres of prismatic ones."),
]
At = Annotated[
    tuple[float, float, float] | None, typer.Option("--at", metavar="X Y Z", help="Tip of a vertical tool, m.")
]
Feed = Annotated[float, typer.Option("--feed", metavar="DEG", help="Direction of feed from the base's x, with --at.")]
Turn = Annotated[float, typer.Option("--turn", metavar="DEG", help="Turn of the redundancy, with --at.")]
Redundancy = Annotated[
    str, typer.Option("--redundancy", help="tool: about the tool's axis; table: tool and work about the feed.")
]
Links = Annotated[
    bool, typer.Option("--links", help="Planar robots: the file's link sections too (others always take links in).")
]
PayloadMass = Annotated[float, typer.Option("--payload", metavar="KG", help="Carried besides the file's bodies.")]
PayloadAt = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--payload-at", metavar="X Y Z", help="Its centre of mass from the tip, tool frame, m."),
]
Weight = Annotated[
    str,
    typer.Option(
        "--weight", help="Deflection under weight: all; change: from the first place on (touched off there); none."
    ),
]
Picture = Annotated[Path | None, typer.Option("--picture", metavar="FILE", help="Picture: .png, .pdf or .svg.")]
Numbers = Annotated[Path | None, typer.Option("--table", metavar="FILE.csv", help="The same numbers as a table.")]
Speed = Annotated[float | None, typer.Option("--speed", metavar="RPM", help="Spindle speed of a posture map.")]
Learned = Annotated[
    Path | None,
    typer.Option("--learned", metavar="POSTURES.json", help="What `robot learn` wrote: a band from measured postures."),
]
