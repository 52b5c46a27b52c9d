"""What a message advises works when it is typed: its command and options are known, and the cases that print it run."""

import ast
import inspect
import logging
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyuff

import millfrf
from millfrf.command_line import BAD_INPUT, DONE, flags_of, run
from millfrf.commands import FORMER_NAMES, STEPS, function_of, words_of
from millfrf.core import conversion_advice
from millfrf.core.steps import describe

ROOT = Path(millfrf.__file__).parents[1]
# what follows the program's name in prose, where no command is meant
PROSE = {
    "reads",
    "or",
    "and",
    "has",
    "as",
    "only",
    "to",
    "is",
    "writes",
    "wrote",
    "in",
    "takes",
    "with",
    "that",
    "an",
    "new",
}
FOREIGN = {"--nthreads", "--user", "--upgrade", "--extra", "--index-url"}  # options of pip and of dask


def literals() -> Iterator[tuple[str, str]]:
    """Texts of all modules with their places; what is filled in is X, and a call of ``command`` its words."""
    for package in ("millfrf", *millfrf.PACKAGES):
        for path in sorted((ROOT / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
            for node in ast.walk(tree):
                place = f"{path.relative_to(ROOT)}, line {getattr(node, 'lineno', 0)}"
                if isinstance(node, ast.JoinedStr):
                    yield place, "".join(map(_shown, node.values))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
                    yield place, node.value


def _shown(part: ast.expr) -> str:
    if isinstance(part, ast.Constant):
        return str(part.value)
    call = part.value if isinstance(part, ast.FormattedValue) else None
    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "command":
        words = [str(word.value) if isinstance(word, ast.Constant) else "X" for word in call.args]
        return "millfrf " + " ".join(words)
    return "X"


def advised(text: str) -> list[str]:
    """Command lines in a text: from the program's name to the end of the clause, without what stands around it."""
    lines = re.findall(r"\bmillfrf((?: (?!then\b)[^\s`'\",;()]+(?<![.:,;]))+)", text.replace("\\'", ""))
    return [line.strip() for line in lines if line.split()[0] not in PROSE or words_of(line.split())]


@cache
def options_of(words: str) -> frozenset[str]:
    """Options that a command takes."""
    options = [option.typed for option in describe(inspect.unwrap(function_of(words))).options if option.public]
    return frozenset([*options, *(f"--{name}" for name in (*flags_of(words), "help"))])


def test_every_command_in_a_text_is_a_command_with_these_options() -> None:
    wrong = []
    for place, text in literals():
        for line in advised(text):
            typed = line.split()
            words = words_of(typed)
            if not words:
                if typed[0][0].islower() and not any(name.startswith(f"{typed[0]} ") for name in STEPS):
                    wrong.append(f"{place}: no command 'millfrf {line}'")
                continue
            named = {word.partition("=")[0] for word in typed if word.startswith("--")} - {"--version"}
            wrong += [f"{place}: 'millfrf {words}' takes no {option}" for option in named - options_of(words)]
    assert wrong == []


def test_every_option_in_a_text_is_an_option_of_some_command() -> None:
    known = FOREIGN.union(*(options_of(words) for words in STEPS), *(map(set, FORMER_NAMES.values())))
    known |= {"--version", "--install-completion"}
    wrong = [
        f"{place}: {option}"
        for place, text in literals()
        for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)
        if option not in known and not text.startswith("#")
    ]
    assert wrong == []


def table_of_points(folder: Path) -> Path:
    path = folder / "points.csv"
    path.write_text("node,x (m),y (m),z (m)\n1,0,0,0\n2,0.1,0,0\n")
    return path


def uff(folder: Path, *sets: dict[str, object]) -> Path:
    path = folder / "of another program.uff"
    pyuff.UFF(str(path)).write_sets(list(sets), "overwrite")
    return path


def places(folder: Path) -> Path:
    zero, x = np.zeros(2), np.array([0.0, 0.1])
    numbers = {"node_nums": np.array([1, 2]), "def_cs": zero, "disp_cs": zero, "color": zero}
    return uff(folder, {"type": 15, **numbers, "x": x, "y": zero, "z": zero})


def shapes(folder: Path) -> Path:
    empty = {f"id{number}": "" for number in range(1, 6)}
    shape = {"r1": np.array([0.0, 0.0]), "r2": np.array([0.0, 0.0]), "r3": np.array([1.0, 0.5])}
    modes = [
        {
            **empty, "type": 55, "analysis_type": 2, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "data_type": 2,
            "n_data_per_node": 3, "load_case": 0, "mode_n": number, "freq": frequency, "modal_m": 2.0,
            "modal_damp_vis": 0.02, "modal_damp_his": 0.0, "node_nums": np.array([1, 2]), **shape,
        }
        for number, frequency in ((1, 30.0), (2, 62.0))
    ]  # fmt: skip
    return uff(folder, *modes)


def columns_of_numbers(folder: Path) -> Path:
    path = folder / "raw.txt"
    time = np.arange(2000) / 1000.0
    rows = np.column_stack([time, 100 * np.sin(6.28 * 30 * time), np.cos(6.28 * 30 * time)])
    np.savetxt(path, rows, delimiter=",", header="Time (s),Fz (N),acc_z (m/s^2)", comments="")
    return path


WRITER = """
import os, sys, numpy as np
from acquisition import Channel, RecordingWriter, StreamDescription
channels = (Channel("fx", "force", "N"), Channel("ax", "acceleration", "m/s^2"))
writer = RecordingWriter(sys.argv[1], [StreamDescription("main", 1000.0, 0.0, channels)], block_length=500)
rng = np.random.default_rng(1)
for _ in range(100):
    writer.append("main", rng.standard_normal((1000, 2)))
os._exit(9)
"""


def cut_short(folder: Path) -> Path:
    """Recording that a power failure ended: its writer did not close it, and its last bytes are lost."""
    path = folder / "cut.h5"
    subprocess.run([sys.executable, "-c", WRITER, str(path)], check=False)
    os.truncate(path, int(path.stat().st_size * 0.97))
    return path


@pytest.mark.parametrize(
    ("make", "typed", "says"),
    [
        (table_of_points, "inspect {}", "points.toml"),
        (places, "inspect {}", ".toml"),
        (shapes, "inspect {}", ".json"),
        (shapes, "fit {} --out model.json", ".json"),
        (columns_of_numbers, "tap {} --out frf.h5", "new mapping"),
        (columns_of_numbers, "inspect {}", "new mapping"),
        (columns_of_numbers, "estimate {} --out frf.h5", "new mapping"),
        (cut_short, "inspect {}", "millfrf recover"),
        (cut_short, "estimate {} --out frf.h5", "millfrf recover"),
    ],
)
def test_the_advice_of_a_refusal_works_when_typed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    make: Callable[[Path], Path],
    typed: str,
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = make(tmp_path)
    assert run([word.format(path) for word in typed.split()]) == BAD_INPUT
    said = capsys.readouterr().err
    assert says in said
    lines = [line.strip() for line in re.findall(r"millfrf ([a-z].*?)(?=, then|$)", said.split("millfrf: ", 1)[1])]
    assert lines
    for line in lines:
        words = shlex.split(line)
        code = run(words)
        answer = capsys.readouterr()
        if words[:1] == ["convert"] and "--map" in words and code == BAD_INPUT:
            assert "FILL IN" in Path("map.toml").read_text()  # a direction that no file states is asked
            continue
        assert code == DONE, answer.err


def test_a_name_with_blanks_is_quoted(tmp_path: Path) -> None:
    path = tmp_path / "my cut.mat"
    path.touch()
    for line in re.findall(r"millfrf (.*?)(?=, then|$)", conversion_advice(path)):
        assert str(path) in shlex.split(line)


def test_the_kind_of_a_universal_file_decides_on_the_advice(tmp_path: Path) -> None:
    frf = tmp_path / "frf.uff"
    shutil.copy(places(tmp_path), frf)
    located = frf.read_text()
    for kind, expected in ((4, "frf.h5"), (1, "new mapping")):
        function = f"    -1\n    58\n{4 * 'text' + 3 * chr(10)}\n\n{kind:5}{0:10}{1:5}{0:10}\n    -1\n"
        frf.write_text(located + function)
        assert expected in conversion_advice(frf)


@pytest.mark.parametrize("how", ["numpy", "logging"])
def test_an_unforeseen_warning_of_a_library_is_one_line_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    def warns(path: object) -> object:
        for _ in range(2):
            if how == "numpy":
                warnings.warn("invalid value encountered in multiply", UserWarning, stacklevel=1)
            else:
                logging.getLogger("reader").warning("cannot find mesh\n%s", path)
        raise millfrf.core.InputError("no such file")

    import millfrf.steps.inspect as steps

    monkeypatch.setattr(steps, "inspect_file", warns)
    assert run(["inspect", "a.h5"]) == BAD_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert said[0].startswith("warning: a library warns of something that this program does not foresee (")
    assert ("invalid value encountered" in said[0]) == (how == "numpy")
