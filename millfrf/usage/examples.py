"""An example for each command, shown below its `--help` and on its page, and plain words for what options take."""

from collections.abc import Iterator
from typing import Any

EXAMPLES: dict[str, str] = {
    "demo": "millfrf demo --out millfrf-demo",
    "plan": "millfrf plan cut.toml",
    "acquire": "millfrf acquire session.toml --out rec1.h5 --live",
    "recover": "millfrf recover rec1.h5",
    "inspect": "millfrf inspect rec1.h5",
    "convert": "millfrf convert cut1.mat rec1.h5 --map channels.toml",
    "estimate": "millfrf estimate rec1.h5 rec2.h5 rec3.h5 --out frf.h5",
    "tap": "millfrf tap hit1.h5 hit2.h5 --out taps.h5",
    "fit": "millfrf fit rec1.h5 rec2.h5 rec3.h5 --band 13 60 --out housing.json",
    "calibrate": "millfrf calibrate housing.json --tip tt.h5 --sensor st.h5 --out tip.json",
    "lobes": "millfrf lobes tip.json --cutting cut.toml --speeds 300 2400 200 --max-depth 0.01 --out lobes.csv",
    "chatter": "millfrf chatter rec1.h5 rec2.h5 --cutting cut.toml --model tip.json --out chatter.json",
    "predict": "millfrf predict tip.json rec1.h5 --out predicted.h5",
    "diagnose": "millfrf diagnose idle.json low.h5 mid.h5 high.h5 --out diagnosis",
    "campaign": "millfrf campaign campaign.toml --workers 2 --out results",
    "report": "millfrf report rec1.h5 frf.h5 housing.json lobes.csv --out report.html",
    "robot diagnose": "millfrf robot diagnose robot.toml a.h5 b.h5 --pose home --pose 0,-10,100,0,90,0 --out found",
    "robot update": "millfrf robot update robot.toml a.h5 b.json --pose home --pose 0,-10,100,0,90,0 --out new.toml",
    "robot list": "millfrf robot list kuka_kr90_r3100",
    "robot show": "millfrf robot show kuka_kr90_r3100 --at 2.0 0 0.8 --out robot.html",
    "robot modes": "millfrf robot modes kuka_kr90_r3100 --joints 0,-10,100,0,90,0 --picture modes.html",
    "robot frf": "millfrf robot frf kuka_kr90_r3100 --at 2.0 0 0.8 --out tip.json",
    "robot stiffness": "millfrf robot stiffness kuka_kr90_r3100 --at 2.0 0 0.8 --table stiffness.csv",
    "robot deviation": "millfrf robot deviation kuka_kr90_r3100 --drill 8 --z 0.7 --out holes.csv",
    "robot lobes": "millfrf robot lobes kuka_kr90_r3100 --at 2.0 0 0.8 --cutting cut.toml --speeds 2000 4000 21"
    " --max-depth 0.01 --out lobes.csv",
    "robot map": "millfrf robot map staubli_rx170 --cutting cut.toml --speed 3000 --feed 90 --picture map.png",
    "robot compensate": "millfrf robot compensate kuka_kr90_r3100 path.csv --payload 30 --out corrected.csv",
    "robot learn": "millfrf robot learn kuka_kr90_r3100 a.json b.json --pose home --pose 0,-10,100,0,90,0"
    " --out postures.json",
    "robot identify": "millfrf robot identify robot.toml deflections.csv --error 37 --out identified.toml",
    "robot path": "millfrf robot path kuka_kr90_r3100 path.csv --cutting cut.toml --speed 3000 --out along",
    "new mapping": "millfrf new mapping cut1.mat --out channels.toml",
    "new cut": "millfrf new cut --teeth 2 --diameter 0.0127 --out cut.toml",
    "new session": "millfrf new session --driver ni --channels 6 --out session.toml",
    "new robot": "millfrf new robot robot.urdf --flange flange --out robot.toml",
    "new campaign": "millfrf new campaign 'recordings/*.h5' --robot kuka_kr90_r3100 --out campaign.toml",
    "new schemas": "millfrf new schemas --out schemas",
    "cut diagnose": "millfrf cut diagnose cut.toml low.h5 high.h5 --depth 0.001 --out found",
}
"""By the words of the command."""

_TAKES = (("int", "N"), ("float", "NUMBER"), ("str", "TEXT"), ("Path", "FILE"))


def commands_in(group: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Words and object of each command below a group, as the parser knows them.

    Parameters
    ----------
    group
        The whole program, or a group of it.
    before
        Words of the group.
    """
    for name, command in group.commands.items():
        words = f"{before} {name}".strip()
        if hasattr(command, "commands"):
            yield from commands_in(command, words)
        else:
            yield words, command


def with_examples(program: Any) -> Any:
    """The program with an example below each command's help, and plain words for what its options take."""
    for words, command in commands_in(program):
        command.epilog = f"\b\nExample:\n  {EXAMPLES[words]}"
        for one in command.params:
            if one.param_type_name == "argument":
                one.display_type_rich = _no_type  # newer versions of typer show `<list[Path]>` behind the name
            elif one.metavar is None and not one.is_flag and one.name != "help":
                one.metavar = _plain(one)
    return program


def _no_type(ctx: object) -> None:
    """Nothing behind an argument's name: the name says what it takes."""
    del ctx


def _plain(option: Any) -> str | None:
    """What an option takes, from its annotation; None where it chooses from a list."""
    annotation = getattr(getattr(option, "type_descriptor", None), "annotation", None)
    kind = str(annotation if annotation is not None else getattr(option.type, "name", option.type))
    return next((word for name, word in _TAKES if name in kind), None)
