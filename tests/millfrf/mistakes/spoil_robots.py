"""Ways to spoil a robot's file."""

from pathlib import Path

from spoil_texts import toml

RAIL = """
[[frames]]
name = "rail"
antecedent = "0"
motion = "prismatic"
alpha_deg = 90.0
{limits}
source = "test"
[[frames]]
name = "carriage"
antecedent = "rail"
motion = "fixed"
alpha_deg = -90.0
source = "test"
"""
ON_RAIL = """
[[joints]]
frame = "rail"
nodes = [0, 12]
axial_n_per_m = 5e7
source = "test"
[[links]]
nodes = [12, 13]
source = "test"
[[points]]
node = 13
frame = "carriage"
at_m = [0.0, 0.0, 0.0]
source = "test"
"""


def rail(folder: Path, limits: str) -> None:
    """A robot on a rail, whose file states the rail's limits by this line."""
    from importlib.resources import files

    text = (files("millfrf.robot_model") / "robots" / "kuka_kr90_r3100.toml").read_text(encoding="utf-8")
    text = text.replace('antecedent = "0"\nr_m = 0.675', 'antecedent = "carriage"\nr_m = 0.675')
    head, tail = text.split("[[frames]]", 1)
    tail = tail.replace("nodes = [0, 1]", "nodes = [13, 1]", 1)
    tail = tail.replace("driven_deg = [0.0, -10.0", "driven = [2.0, 0.0, -10.0")
    (folder / "rail.toml").write_text(
        head + RAIL.format(limits=limits) + "[[frames]]" + tail + ON_RAIL, encoding="utf-8"
    )


def robot(folder: Path, *lines: str) -> None:
    """A robot's file beside the others, lines replaced as :func:`toml` does."""
    from importlib.resources import files

    content = (files("millfrf.robot_model") / "robots" / "staubli_rx170.toml").read_text(encoding="utf-8")
    (folder / "robot.toml").write_text(content, encoding="utf-8")
    toml(folder, "robot.toml", *lines)
