"""Arguments of wrong types, to every step: one line that names the argument, its value and what is expected."""

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest

import millfrf as mf
from estimation import write_frf
from millfrf.core.steps import Option, Reads, describe
from millfrf.cutting import write_cutting_process
from modal_fit import write_modal_model

STEPS = [
    name for name in dir(mf) if inspect.isfunction(step := getattr(mf, name)) and hasattr(step, "__wrapped__")
    and name != "accepting_edited"
]  # fmt: skip
WRONG: dict[str, Any] = {
    "nothing": None,
    "a number": 3.5,
    "a list of a number": [700],
    "a dict": {"a": 1},
    "no file": Path("not_there.h5"),
    "an array": np.zeros((5, 2)),
    "a class": dict,
}


def _options(name: str) -> tuple[Option, ...]:
    return describe(inspect.unwrap(getattr(mf, name))).options


def _placeholder(option: Option) -> Any:
    """A value of the right type, so that only the argument in question is wrong; its file is missing."""
    kinds = {"float": 1.0, "tuple[float, float, int]": (600.0, 900.0, 3)}
    return kinds.get(getattr(option.annotation, "__name__", ""), kinds.get(str(option.annotation), "missing.h5"))


def _call(name: str, argument: str, value: Any) -> Any:
    positional: list[Any] = []
    named: dict[str, Any] = {}
    signature = inspect.signature(inspect.unwrap(getattr(mf, name)))
    for option in _options(name):
        if option.name != argument and not (option.needed or option.several):
            continue
        given = value if option.name == argument else _placeholder(option)
        if signature.parameters[option.name].kind in (
            inspect.Parameter.POSITIONAL_ONLY,
            inspect.Parameter.VAR_POSITIONAL,
        ):
            positional.append(given)
        elif option.name == argument or option.default is inspect.Parameter.empty:
            named[option.name] = given
    return getattr(mf, name)(*positional, **named)


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("name", STEPS)
def test_every_argument_of_every_step_is_refused_in_one_line(
    name: str, wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for option in _options(name):
        try:
            _call(name, option.name, WRONG[wrong])
        except mf.InputError as refused:
            text = str(refused)
        else:
            pytest.fail(f"mf.{name}({option.name}={WRONG[wrong]!r}) was accepted")
        assert "\n" not in text
        assert len(text) < 400, text
        needed = option.default is inspect.Parameter.empty
        if wrong in ("a dict", "a class", "an array") or (wrong == "nothing" and needed):
            assert text.startswith(option.name), f"mf.{name}({option.name}={WRONG[wrong]!r}): {text}"
            assert ": give " in text, text


CASES: dict[str, tuple[Any, str]] = {
    "a class as dynamics": (lambda: mf.lobes(dict), r"dynamics <class 'dict'>: give the name of a file, a ModalModel"),
    "a band of one": (lambda: mf.fit("frf.h5", band=[700]), r"band \[700\]: give 2 numbers LO HI, in Hz"),
    "a number as cut": (lambda: mf.lobes("m.json", 3), "cutting 3: give the name of a file or a MillingProcess"),
    "no model": (lambda: mf.diagnose(None, "r.h5"), "model None: give the name of a file"),
    "an array": (lambda: mf.estimate(np.zeros(5)), r"recordings array of shape \(5,\): give .*Recording"),
    "a list of files": (lambda: mf.estimate(["a.h5", "b.h5"]), r"recordings \['a.h5', 'b.h5'\]: .*estimate\(\*"),
    "a text as number": (lambda: mf.estimate("a.h5", segment="8"), "segment '8': give a number, in s"),
    "a truth as number": (lambda: mf.estimate("a.h5", segment=True), "segment True: give a number, in s"),
    "a broken count": (lambda: mf.fit("a.h5", modes=2.5), "modes 2.5: give a whole number"),
    "texts in a band": (lambda: mf.fit("a.h5", band=("a", "b")), "band .'a', 'b'.: give 2 numbers LO HI, in Hz"),
    "no text": (lambda: mf.estimate("a.h5", stream=3), "stream 3: give a text"),
    "numbers as names": (lambda: mf.estimate("a.h5", responses=[3]), r"responses \[3\]: give a text or a list"),
    "no number": (lambda: mf.estimate("a.h5", segment=float("nan")), "segment nan: give a number, in s"),
    "an unknown name": (lambda: mf.fit("a.h5", bnd=(1, 2)), "fit has no argument 'bnd'; did you mean band"),
    "a missing one": (lambda: mf.lobes("m.json"), "lobes needs cutting: Cutter, engagement and force coefficients"),
    "too many": (lambda: mf.lobes("m.json", "c.toml", 3), "lobes: takes 2 without a name, 3 are given; "),
    "a switch": (lambda: mf.estimate("a.h5", exclude="yes"), "exclude 'yes': give True or False"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_line_says_what_to_give(name: str) -> None:
    call, message = CASES[name]
    with pytest.raises(mf.InputError, match=message):
        call()


def test_quantities_are_converted_to_the_unit_of_the_argument() -> None:
    units = pint.UnitRegistry()
    with pytest.raises(mf.InputError, match=r"segment -2 s: give a number above 0 s"):
        mf.estimate("a.h5", segment=-2000 * units.ms)
    with pytest.raises(mf.InputError, match=r"band 700 to 60 Hz is not two increasing"):
        mf.fit("a.h5", band=(0.7 * units.kHz, 60))
    with pytest.raises(mf.InputError, match=r"band 700 to 60 Hz is not two increasing"):
        mf.fit("a.h5", band=[0.7, 0.06] * units.kHz)
    with pytest.raises(mf.InputError, match="segment 3 meter: give it in s, or in a unit that is converted to s"):
        mf.estimate("a.h5", segment=3 * units.m)
    with pytest.raises(mf.InputError, match="speed 20 hertz: give it in rpm"):
        mf.chatter("a.h5", speed=20 * units.Hz)
    with pytest.raises(mf.InputError, match=r"band .*: give it in Hz"):
        mf.fit("a.h5", band=[600, 700] * units.rpm)
    with pytest.raises(mf.InputError, match=r"overlap 1\.2: .*below 1"):
        mf.estimate("a.h5", overlap=120 * units.percent)


def test_a_time_is_a_number_or_a_word() -> None:
    units = pint.UnitRegistry()
    with pytest.raises(mf.InputError, match=r"--exponential -0\.2 is not understood; give auto, none or a time in s"):
        mf.tap("a.h5", exponential=-200 * units.ms)
    with pytest.raises(mf.InputError, match=r"exponential \[0\.2\]: give a text or a number, in s"):
        mf.tap("a.h5", exponential=[0.2])
    with pytest.raises(mf.InputError, match="no file"):
        mf.tap("a.h5", exponential=0.2, force_window="none")


def test_numbers_of_numpy_are_numbers() -> None:
    with pytest.raises(mf.InputError, match="no file"):
        mf.fit("a.h5", band=np.array([5.0, 60.0]), modes=np.int64(3))
    with pytest.raises(mf.InputError, match=re.escape("no such file") + "|no file"):
        mf.estimate("a.h5", segment=np.float32(2.0), responses=np.array(["ax"]))


GOOD = {
    "MODEL.json": "m.json",
    "MODEL.json|FRF.h5": "m.json",
    "CUT.toml": "cut.toml",
    "REC": "rec.h5",
    "REC.h5": "rec.h5",
}
GOOD |= dict.fromkeys(("FRF.h5", "TT.h5", "ST.h5", "FRF.h5|REC..."), "frf.h5") | {"REC...": "rec.h5"}
OTHERS = {"report": {"out": "page.html"}, "chatter": {"teeth": 2}, "diagnose": {"band": (20.0, 90.0), "out": "found"}}
SPEEDS = {"speed": 600.0, "speeds": (600.0, 900.0, 3), "depth": 1e-3}


@pytest.fixture(scope="module")
def good_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, an FRF, a recording and a cutting file."""
    folder = tmp_path_factory.mktemp("good")
    axes, vectors = ("TCP:+X", "TCP:+Y", "TCP:+Z"), np.diag([1e-2, 1e-2, 1e-2]).astype(complex)
    model = mf.ModalModel(
        np.array([-12 + 300j, -15 + 420j, -20 + 600j]), vectors, -1j * vectors, axes, axes, band=(20, 99)
    )
    write_modal_model(folder / "m.json", model)
    write_frf(folder / "frf.h5", model.frf(np.linspace(20.0, 99.0, 201)))
    cut = mf.milling_process(teeth=2, diameter_m=0.01, ktc_pa=1e8, krc=0.3, start_angle_deg=90, exit_angle_deg=180)
    write_cutting_process(folder / "cut.toml", cut)
    noise = np.random.default_rng(1).normal(size=(4000, 2))
    mf.Recording.from_arrays(noise, 500, {"fx": "N TCP:+X", "ax": "g TCP:+X"}).save(folder / "rec.h5")
    return folder


@pytest.mark.parametrize(
    "name",
    [
        "calibrate",
        "chatter",
        "cut_simulate",
        "cut_wall",
        "diagnose",
        "estimate",
        "fit",
        "inspect",
        "lobes",
        "predict",
        "report",
        "tap",
    ],
)
def test_a_file_that_does_not_exist_is_named(name: str, good_files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All other files are good, so that each step comes to the one that is missing."""
    monkeypatch.chdir(good_files)
    files = [option for option in _options(name) if isinstance(option.marker, Reads)]
    for missing in files:
        positional: list[Any] = []
        named: dict[str, Any] = {}
        for option in _options(name):
            needed = option.default is inspect.Parameter.empty
            if option is not missing and not needed:
                continue
            given = GOOD.get(option.marker.metavar, SPEEDS.get(option.name, "rec.h5"))
            given = Path("not_there.h5") if option is missing else given
            if option.positional:
                positional.append(given)
            else:
                named[option.name] = given
        named |= OTHERS.get(name, {})
        with pytest.raises(mf.InputError, match=r"not_there\.h5") as refused:
            getattr(mf, name)(*positional, **named)
        assert "\n" not in str(refused.value)
