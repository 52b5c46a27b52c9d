"""The commands: their words, and the step behind each. Nothing of a step is imported here, so that help is quick."""

import ast
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

STEPS: Mapping[str, str] = {
    "demo": "millfrf.demonstration.demo:demo",
    "plan": "millfrf.steps.plan:plan",
    "acquire": "millfrf.steps.recording.acquire:acquire",
    "recover": "millfrf.steps.recording.recover:recover",
    "inspect": "millfrf.steps.inspect:inspect",
    "convert": "millfrf.steps.convert:convert",
    "estimate": "millfrf.steps.estimate:estimate",
    "tap": "millfrf.steps.tap:tap",
    "tool": "millfrf.steps.tool:tool",
    "fit": "millfrf.steps.fit:fit",
    "calibrate": "millfrf.steps.calibrate:calibrate",
    "lobes": "millfrf.steps.lobes:lobes",
    "chatter": "millfrf.steps.chatter:chatter",
    "watch": "millfrf.steps.recording.watch:watch",
    "learn": "millfrf.steps.learn:learn",
    "predict": "millfrf.steps.predict:predict",
    "diagnose": "millfrf.steps.diagnose:diagnose",
    "campaign": "millfrf.campaign.campaign_run:campaign",
    "report": "millfrf.steps.report:report",
    "app": "millfrf.app.app:app",
    "repeat": "millfrf.app.saved_work:repeat",
    "robot diagnose": "millfrf.steps.robot.diagnose:diagnose_robot",
    "robot update": "millfrf.steps.robot.update:update_robot",
    "robot list": "millfrf.steps.robot.robots:list_robots",
    "robot show": "millfrf.steps.robot.robot_page:show_robot",
    "robot modes": "millfrf.steps.robot.modes:robot_modes",
    "robot frf": "millfrf.steps.robot.frf:robot_frf",
    "robot stiffness": "millfrf.steps.robot.stiffness:robot_stiffness",
    "robot deviation": "millfrf.steps.robot.deviation:robot_deviation",
    "robot lobes": "millfrf.steps.robot.lobes:robot_lobes",
    "robot map": "millfrf.steps.robot.maps:robot_map",
    "robot compensate": "millfrf.steps.robot.compensate:compensate",
    "robot learn": "millfrf.steps.robot.learn:learn_postures",
    "robot identify": "millfrf.steps.robot.identify:identify_stiffness",
    "robot path": "millfrf.steps.robot.path:robot_path",
    "robot advice": "millfrf.steps.robot.advice:robot_advice",
    "new mapping": "millfrf.new.mapping_file:new_mapping",
    "new cut": "millfrf.new.templates:new_cut",
    "new session": "millfrf.new.templates:new_session",
    "new robot": "millfrf.new.robot_file:new_robot",
    "new campaign": "millfrf.new.templates:new_campaign",
    "new schemas": "millfrf.new.templates:new_schemas",
    "cut identify": "millfrf.steps.cut_identify:cut_identify",
    "cut diagnose": "millfrf.steps.cut_diagnose:cut_diagnose",
    "cut simulate": "millfrf.steps.cut_simulate:cut_simulate",
    "cut wall": "millfrf.steps.cut_wall:cut_wall",
}
"""Module and function of each command by its words, in the order in which the help lists them."""

FORMER_NAMES: Mapping[str, Mapping[str, str]] = {
    "robot lobes": {"--angles": "--turns"},
    "robot path": {"--table": "--table-turns"},
    "robot modes": {"--count": "--modes"},
    "robot deviation": {
        "--spindle-speed": "--speed",
        "--force-error": "--force-uncertainty",
        "--stiffness-error": "--stiffness-uncertainty",
    },
    "robot frf": {"--sensor": "--sensor-at"},
    "robot update": {"--sensor": "--sensor-at", "--feed": "--channels-turned"},
    "robot diagnose": {"--sensor": "--sensor-at", "--feed": "--channels-turned"},
    "robot learn": {"--feed": "--channels-turned"},
    "new robot": {"--tip": "--flange"},
}
"""Former and present name of options, by the words of the command; no help shows the former ones."""


def words_of(arguments: Sequence[str]) -> str:
    """Words of the command at the beginning of a command line; empty where there is none.

    Examples
    --------
    >>> words_of(["robot", "frf", "kuka_kr90_r3100"]), words_of(["fit", "frf.h5"]), words_of(["--help"])
    ('robot frf', 'fit', '')
    """
    return next((words for n in (2, 1) if (words := " ".join(arguments[:n])) in STEPS), "")


def function_of(words: str) -> Callable[..., Any]:
    """Import the step behind a command.

    Parameters
    ----------
    words
        Words of the command.
    """
    module, _, name = STEPS[words].partition(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def summary_of(words: str) -> str:
    """First line of a step's docstring, read from its source.

    Parameters
    ----------
    words
        Words of the command.
    """
    module, _, name = STEPS[words].partition(":")
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    functions = (node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name)
    return (ast.get_docstring(next(functions, tree)) or "").split("\n")[0]
