"""Poles picked in the browser: what the page is told, what it may send, and a file that repeats the fit."""

import asyncio
import base64
import http.client
import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import run
from millfrf.core import InputError, MillfrfError
from millfrf.live.picking import PickSession, Pole, as_poles, chosen_at_first, drawn_page, fitted_answer
from millfrf.live.picking_server import pick_poles, write_picked
from millfrf.steps.fit import fit
from modal_fit import ModalModel, fit_polyreference, read_modal_model, read_picked_poles

BAND = (5.0, 60.0)
TRUE = [(16.0, 0.02), (31.0, 0.015), (42.0, 0.03)]
DOFS = ("TCP:+X", "TCP:+Y")


@pytest.fixture(scope="module")
def session() -> PickSession:
    shapes = 1e-3 * np.array([[1.0, 0.5], [0.7, -0.9], [0.3, -1.0]], dtype=complex)
    true = ModalModel(as_poles(TRUE), shapes, -1j * shapes, DOFS, DOFS)
    frf = true.frf(np.linspace(1.0, 80.0, 800))
    return PickSession("frf.h5", frf, fit_polyreference(frf, BAND))


def test_the_automatic_choice_comes_first_and_the_chart_offers_its_poles(session: PickSession) -> None:
    assert np.array(chosen_at_first(session)) == pytest.approx(np.array(TRUE), rel=1e-3)
    page = json.loads(drawn_page(session))
    assert page["band"] == list(BAND)
    assert [one["label"] for one in page["choices"]] == [f"TCP:+{p} / TCP:+{q}" for q in "XY" for p in "XY"]
    assert all(BAND[0] <= f <= BAND[1] and 0 < zeta < 0.5 for f, zeta, _ in page["poles"])
    assert any(abs(f - 31.0) < 0.01 for f, _, _ in page["poles"])


def _fitted(answer: dict[str, Any], name: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(answer["fitted"][name]), "<f4")


def test_all_poles_synthesise_the_measured_frf_and_one_less_does_not(session: PickSession) -> None:
    whole = fitted_answer(session, {"poles": [list(one) for one in TRUE], "entry": 1})
    assert whole["misfit"] < 0.1
    f, size = _fitted(whole, "f"), _fitted(whole, "size")
    measured = np.abs(session.frf.values[:, 1, 0])
    assert np.interp(31.0, f, size) == pytest.approx(np.interp(31.0, session.frf.frequencies, measured), rel=0.02)
    fewer = fitted_answer(session, {"poles": [list(TRUE[0]), list(TRUE[2])], "entry": 1})
    assert fewer["misfit"] > 20


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["no", "object"], "no list of poles"),
        ({"poles": []}, "0 poles are chosen"),
        ({"poles": [[16.0]]}, "pole 1 is"),
        ({"poles": [[16.0, "0.02"]]}, "pole 1 is"),
        ({"poles": [[16.0, True]]}, "pole 1 is"),
        ({"poles": [[16.0, 0.7]]}, "above 0 and below 50 %"),
        ({"poles": [[float("nan"), 0.02]]}, "pole 1 is"),
        ({"poles": [[70.0, 0.02]]}, "outside the band"),
        ({"poles": [[16.0, 0.02], [16.0, 0.02]]}, "same"),
        ({"poles": [[16.0, 0.02]], "entry": 4}, "no FRF number 4"),
        ({"poles": [[16.0, 0.02]], "entry": "0"}, "no FRF number"),
        ({"poles": [[16.0, 0.02]] * 201}, "choose 1 to 200"),
    ],
)
def test_what_is_no_choice_is_told_in_one_line(session: PickSession, asked: object, words: str) -> None:
    answer = fitted_answer(session, asked)
    assert words in answer["error"]
    assert "\n" not in answer["error"]


def _asked(url: str, method: str, name: str, body: str = "", **headers: str) -> tuple[int, dict[str, str], bytes]:
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=20)
    origin = {"Origin": f"http://{parts.netloc}"} if method == "POST" else {}
    connection.request(method, parts.path + name, body or None, {**origin, **headers})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), content


def _served(session: PickSession, visit: Callable[[str], None]) -> list[Pole]:
    """Serve the page, visit it from another thread as a browser would, and give what was picked."""
    failed: list[BaseException] = []

    def visited(url: str) -> None:
        try:
            visit(url)
        except BaseException as error:
            failed.append(error)
            _asked(url, "POST", "leave")

    try:
        return pick_poles(session, lambda _: None, lambda url: threading.Thread(target=visited, args=(url,)).start())
    finally:
        if failed:
            raise failed[0]


def test_a_choice_is_saved_and_strangers_are_turned_away(session: PickSession) -> None:
    good = json.dumps({"poles": [list(one) for one in TRUE[:2]], "entry": 0})

    def visit(url: str) -> None:
        status, headers, page = _asked(url, "GET", "")
        assert status == 200
        assert b"Pick poles" in page
        assert "script-src 'self'" in headers["Content-Security-Policy"]
        for name in ("picking.js", "picking.css", "page.json", "bokeh.min.js"):
            assert _asked(url, "GET", name)[0] == 200
        assert _asked(url, "GET", "", Host="evil.example")[0] == 421
        assert _asked(url.replace(url[-8:], "xxxxxxx/"), "GET", "")[0] == 404
        assert _asked(url, "POST", "save", good, Origin="http://evil.example")[0] == 403
        assert _asked(url, "POST", "save", "{not JSON")[0] == 400
        assert "outside" in json.loads(_asked(url, "POST", "save", '{"poles": [[70, 0.02]]}')[2])["error"]
        assert json.loads(_asked(url, "POST", "fit", good)[2])["misfit"] > 0
        assert json.loads(_asked(url, "POST", "save", good)[2]) == {"done": "saved"}

    assert _served(session, visit) == TRUE[:2]


def test_a_page_that_is_left_picks_nothing(session: PickSession) -> None:
    with pytest.raises(MillfrfError, match="nothing is written"):
        _served(session, lambda url: _asked(url, "POST", "leave") and None)


def test_a_request_that_is_too_large_ends(session: PickSession) -> None:
    def visit(url: str) -> None:
        try:
            status = _asked(url, "POST", "fit", " " * 100_000)[0]
        except (http.client.HTTPException, ConnectionError):
            status = 400  # the connection was closed
        assert status >= 400
        _asked(url, "POST", "leave")

    with pytest.raises(MillfrfError):
        _served(session, visit)


def test_the_file_repeats_the_choice_to_the_last_digit(session: PickSession, tmp_path: Path) -> None:
    frf, picked = tmp_path / "frf.h5", tmp_path / "poles.toml"
    write_frf(frf, session.frf)
    chosen = [(31.000000123, 0.0151234567891), (16.0, 0.02), (42.0, 0.03)]
    write_picked(picked, chosen, frf, BAND)
    assert read_picked_poles(picked).tolist() == as_poles(sorted(chosen)).tolist()
    out = tmp_path / "model.json"
    assert run(["fit", str(frf), "--band", "5", "60", "--poles", str(picked), "--out", str(out)]) == 0
    assert read_modal_model(out).natural_frequencies == pytest.approx([16.0, 31.000000123, 42.0], rel=1e-9)


@pytest.mark.long
def test_the_command_writes_the_choice_and_the_model(
    session: PickSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frf, picked, out = tmp_path / "frf.h5", tmp_path / "poles.toml", tmp_path / "model.json"
    write_frf(frf, session.frf)

    def browser(url: str) -> bool:
        body = json.dumps({"poles": [[16.0, 0.02], [42.0, 0.03]], "entry": 0})
        threading.Thread(target=_asked, args=(url, "POST", "save", body)).start()
        return True

    monkeypatch.setattr("webbrowser.open", browser)
    assert run(["fit", str(frf), "--band", "5", "60", "--pick", str(picked), "--out", str(out)]) == 0
    assert len(read_picked_poles(picked)) == 2
    assert read_modal_model(out).natural_frequencies == pytest.approx([16.0, 42.0], rel=1e-6)


def test_options_that_contradict_a_choice_are_refused(session: PickSession, tmp_path: Path) -> None:
    frf, picked = tmp_path / "frf.h5", tmp_path / "poles.toml"
    write_frf(frf, session.frf)
    out = tmp_path / "model.json"
    with pytest.raises(InputError, match="--pick and --poles both choose"):
        fit(frf, out=out, pick=picked, poles=tmp_path / "others.toml")
    with pytest.raises(InputError, match="another picker"):
        fit(frf, out=out, pick=picked, candidates=tmp_path / "candidates.json")
    with pytest.raises(InputError, match="change the suffix"):
        fit(frf, out=out, pick=tmp_path / "poles.txt")


def test_an_interrupt_leaves_nothing_open(session: PickSession) -> None:
    def interrupted(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises((KeyboardInterrupt, asyncio.CancelledError)):
        pick_poles(session, lambda _: None, interrupted)
