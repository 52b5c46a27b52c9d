"""Poles picked in the browser: the fit of a choice, what a click picks, and a file that repeats the fit."""

import asyncio
import http.client
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import run
from millfrf.core import InputError, MillfrfError
from millfrf.live import picking_server
from millfrf.live.picking import (
    PickSession,
    Pole,
    as_poles,
    chart_poles,
    checked_pole,
    chosen_at_first,
    entry_label,
    fit_choice,
    grid_of,
    nearest_pole,
)
from millfrf.live.picking_page import PickingPage
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
    labels = [entry_label(session, k) for k in range(len(session.entries))]
    assert labels == [f"TCP:+{p} / TCP:+{q}" for q in "XY" for p in "XY"]
    f, zeta = chart_poles(session)[:, :2].T
    assert ((BAND[0] <= f) & (f <= BAND[1]) & (zeta > 0) & (zeta < 0.5)).all()
    assert np.abs(f - 31.0).min() < 0.01


def test_one_mode_in_two_directions_is_chosen_once() -> None:
    """Without cross terms each direction is fitted on its own: a mode of both would stand twice."""
    shapes = 1e-3 * np.array([[1.0, 0.9]], dtype=complex)
    frf = ModalModel(as_poles(TRUE[:1]), shapes, -1j * shapes, DOFS, DOFS).frf(np.linspace(1.0, 80.0, 800))
    values = frf.values * np.eye(2)
    direct = replace(frf, values=values, measured=np.eye(2, dtype=bool))
    session = PickSession("frf.h5", direct, fit(direct, band=BAND))  # type: ignore[arg-type]
    assert len([group for group in session.groups if group.taken]) == 2
    assert len(chosen_at_first(session)) == 1
    assert fit_choice(session, chosen_at_first(session), 0).misfits[2] < 0.1


def test_all_poles_synthesise_the_measured_frf_and_one_less_does_not(session: PickSession) -> None:
    whole = fit_choice(session, TRUE, 1)
    assert whole.misfit < 0.1
    assert whole.curves.fitted is not None
    measured = np.abs(session.frf.values[:, 1, 0])
    fitted = np.interp(31.0, grid_of(session), np.abs(whole.curves.fitted))
    assert fitted == pytest.approx(np.interp(31.0, session.frf.frequencies, measured), rel=0.02)
    assert fit_choice(session, [TRUE[0], TRUE[2]], 1).misfit > 20


@pytest.mark.parametrize(
    ("poles", "words"),
    [
        ([], "0 poles are chosen"),
        ([(70.0, 0.02)], "outside the band"),
        ([(16.0, 0.02), (16.0, 0.02)], "same"),
        ([(16.0, 0.02)] * 201, "choose 1 to 200"),
    ],
)
def test_what_is_no_choice_is_refused_in_one_line(session: PickSession, poles: list[Pole], words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        fit_choice(session, poles, 0)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("typed", [("16", "x"), ("", "2"), ("nan", "2"), ("16", "70"), ("-16", "2"), ("16", "0")])
def test_what_is_no_pole_is_refused(typed: tuple[str, str]) -> None:
    with pytest.raises(InputError, match="give"):
        checked_pole(*typed)
    assert checked_pole(" 16.5", "2") == (16.5, 0.02)


def test_a_click_picks_the_nearest_pole_or_none(session: PickSession) -> None:
    order = float(chart_poles(session)[:, 2].max())
    near = nearest_pole(session, (31.1, order), (0.1, 0.2), "orders")
    assert near == pytest.approx(TRUE[1], rel=1e-3)
    assert nearest_pole(session, (24.0, 2.0), (0.01, 0.01), "damping") is None


def test_the_page_chooses_drops_adds_and_saves(session: PickSession) -> None:
    ended: list[list[Pole] | None] = []
    page = PickingPage(session, ended.append)
    assert page.poles == chosen_at_first(session)

    async def work() -> None:
        page.chosen.value = page.chosen.value[:1]
        assert len(page.poles) == 1
        page.frequency.value, page.damping.value = "42", "3"
        page._add(None)
        page._add(None)  # the same pole stands once
        assert page.poles[-1] == (42.0, 0.03)
        for _ in range(100):  # the fit goes on in a thread
            await asyncio.sleep(0.1)
            if "2 poles: misfit" in page._said.object:
                break
        assert "2 poles: misfit" in page._said.object
        page.frequency.value = "70"
        page._add(None)
        await page._save(None)
        assert "outside the band" in page._said.object
        assert not ended
        page._start_again(None)
        await page._save(None)

    asyncio.run(work())
    assert ended == [chosen_at_first(session)]


def _status(url: str, path: str = "", **headers: str) -> int:
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=20)
    connection.request("GET", path or parts.path, headers=headers)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status


def _served(
    session: PickSession, visit: Callable[[str], None], monkeypatch: pytest.MonkeyPatch, poles: list[Pole] | None
) -> list[Pole]:
    """Serve the page, visit it from another thread, and end it as its buttons do."""
    failed: list[BaseException] = []
    ends: list[Callable[[list[Pole] | None], None]] = []

    class Watched(PickingPage):
        def __init__(self, session: PickSession, ended: Callable[[list[Pole] | None], None]) -> None:
            super().__init__(session, ended)
            loop = asyncio.get_running_loop()
            ends.append(lambda poles: loop.call_soon_threadsafe(ended, poles))

    def visited(url: str) -> None:
        try:
            visit(url)
        except BaseException as error:
            failed.append(error)
        _status(url)
        ends[-1](poles)

    monkeypatch.setattr("millfrf.live.picking_page.PickingPage", Watched)
    try:
        return pick_poles(session, lambda _: None, lambda url: threading.Thread(target=visited, args=(url,)).start())
    finally:
        if failed:
            raise failed[0]


def test_a_choice_is_saved_and_strangers_get_nothing(session: PickSession, monkeypatch: pytest.MonkeyPatch) -> None:
    def visit(url: str) -> None:
        parts = urlsplit(url)
        socket = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        socket |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
        assert _status(url) == 200
        assert _status(url, Host="evil.example") == 404
        assert _status(url, "/") == 404
        assert _status(url, f"{parts.path[:-4]}xxx/") == 404
        assert _status(url, f"{parts.path}ws", Origin="http://evil.example", **socket) == 404
        assert _status(url, f"{parts.path}ws", Origin=f"http://{parts.netloc}", **socket) != 404

    assert _served(session, visit, monkeypatch, TRUE[:2]) == TRUE[:2]


def test_a_page_that_is_left_picks_nothing(session: PickSession, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MillfrfError, match="nothing is written"):
        _served(session, lambda _: None, monkeypatch, None)


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

    monkeypatch.setattr(picking_server, "pick_poles", lambda *_: [(16.0, 0.02), (42.0, 0.03)])
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
