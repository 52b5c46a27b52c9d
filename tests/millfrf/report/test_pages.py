"""The one form of all pages: order of headings, landmarks, tables, pictures, nothing from outside; figures as files."""

import base64
import gzip
import hashlib
import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.core.terminal import Table
from millfrf.figures import GalleryEntry, SmallSvg, ZoomedPlot, gallery_page, house_style, new_figure, save_figure
from millfrf.reports.results_page import FigureFiles, ResultsPage, page_text, write_results_page
from millfrf.reports.section import Fold, Picture, Section, picture_of

FREQUENCIES = np.linspace(1.0, 50.0, 200)


class Read(HTMLParser):
    """What a page holds: elements with their attributes, in order, and the words of each."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self._inside: list[int] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self.words.append("")
        if tag not in ("meta", "img", "input", "br"):
            self._inside.append(len(self.words) - 1)

    def handle_endtag(self, tag: str) -> None:
        while self.elements[self._inside.pop()][0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        for place in self._inside:
            self.words[place] += data

    def all(self, *tags: str) -> list[tuple[dict[str, str], str]]:
        pairs = zip(self.elements, self.words, strict=True)
        return [(attributes, words) for (tag, attributes), words in pairs if tag in tags]


def _lines() -> Picture:
    with house_style():
        figure = new_figure(50.0)
        figure.subplots().plot(FREQUENCIES, np.sin(FREQUENCIES))
    return picture_of(figure, "A sine.", "Sine over frequency")


def _small() -> SmallSvg:
    values = 1e-6 / (400.0 - FREQUENCIES**2 + 8j * FREQUENCIES)
    return gallery_page([GalleryEntry("1:+X / 2:+X", "3 %", values, 1.1 * values)], FREQUENCIES)


def _sections() -> list[Section]:
    table = Table("Modes", ("mode", "", "frequency (Hz)"), (("1", "<b>bold</b>", "16.99"), ("2", "none", "18.48")))
    folded = Fold("FRFs 1 to 1", (table,), (picture_of(_small(), "Panels.", "FRFs 1 to 1"),))
    return [Section("Modal <model>", ("One.",), (table,), (_lines(),), (folded,)), Section("Empty")]


def _page() -> ResultsPage:
    answers = (("Where?", ("Here.",)),)
    return ResultsPage("Kind", "Title <script>", "Made by", ("All is well.",), ("Mind the gap.",), answers)


@pytest.fixture(scope="module")
def text() -> str:
    return page_text(_page(), _sections())


def test_headings_come_in_order_and_the_verdict_first(text: str) -> None:
    headings = [(tag, words) for (tag, _), words in zip(Read(text).elements, Read(text).words, strict=True)]
    levels = [int(tag[1]) for tag, _ in headings if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(later - earlier <= 1 for earlier, later in itertools.pairwise(levels))
    assert [words for tag, words in headings if tag == "h2"] == [
        "In brief",
        "Before you trust it",
        "1 Modal <model>",
    ]


def test_the_first_doubt_on_each_of_three_subjects_stands_open_and_the_others_are_folded() -> None:
    doubts = ("a_b.h5: first.", "a_b.h5: second.", "Third.", "Fourth.", "c.json: fifth.")
    shown = page_text(replace(_page(), warnings=doubts), _sections())
    opened, _, folded = shown.partition("<details>")
    texts = ("first.", "second.", "Third.", "Fourth.", "fifth.")
    assert [text in opened for text in texts] == [True, False, True, True, False]
    assert all(shown.count(text) == 1 for text in texts)
    assert "<li>a_b.h5: first.</li>" in opened
    assert "<summary>2 more</summary>" in folded


def test_the_answer_has_its_picture_before_the_folded_sections() -> None:
    shown = page_text(replace(_page(), picture=_lines()), _sections())
    head, _, sections = shown.partition('<details class="section">')
    assert head.index("All is well.") < head.index('<figure id="figure-1">') < head.index("Mind the gap.")
    assert '<figure id="figure-2">' in sections
    assert not re.search(r'<details class="section"[^>]* open', shown)


def test_figures_that_zoom_are_packed_and_come_out_whole() -> None:
    document = json.dumps({"a": "\u00b2" * 500})
    zoomed = replace(_lines(), zoomed=ZoomedPlot(document, "[]"))
    shown = page_text(replace(_page(), picture=zoomed), _sections())
    read = Read(shown)
    stored = {attributes.get("id") or attributes.get("class"): words for attributes, words in read.all("script")}
    assert gzip.decompress(base64.b64decode(stored["plot"])).decode() == document
    library = gzip.decompress(base64.b64decode(stored["library"]))
    assert base64.b64encode(hashlib.sha256(library).digest()).decode() in shown.partition("</head>")[0]
    assert len(shown) < 0.6 * len(library)


def test_the_skip_link_leads_to_the_answer(text: str) -> None:
    read = Read(text)
    names = [attributes["id"] for _, attributes in read.elements if "id" in attributes]
    assert len(names) == len(set(names))
    assert [attributes["href"] for attributes, _ in read.all("a")] == ["#content"]
    assert "content" in names
    assert {tag for tag, _ in read.elements} >= {"main", "header", "footer"}
    labelled = [attributes["aria-labelledby"] for _, attributes in read.elements if "aria-labelledby" in attributes]
    assert set(labelled) <= set(names)


def test_tables_have_captions_and_scopes_and_pictures_have_words(text: str) -> None:
    read = Read(text)
    assert len(read.all("table")) == len(read.all("caption")) == 2
    assert all(attributes.get("scope") in ("col", "row") for attributes, _ in read.all("th"))
    assert all(words for _, words in read.all("th")), "a heading without words says nothing to a screen reader"
    assert all(attributes["alt"] for attributes, _ in read.all("img"))
    numbers = [words for attributes, words in read.all("td") if attributes.get("class") == "n"]
    assert numbers == ["16.99", "18.48"] * 2


def test_nothing_is_loaded_and_only_the_scripts_of_the_page_run(text: str) -> None:
    read = Read(text)
    addresses = [
        value for _, attributes in read.elements for name, value in attributes.items() if name in ("src", "href")
    ]
    assert all(address.startswith(("data:image/", "#")) for address in addresses)
    assert "url(" not in text
    assert "<b>bold" not in text
    policy = next(each["content"] for each, _ in read.all("meta") if each.get("http-equiv"))
    assert "default-src 'none'" in policy
    scripts = [words for attributes, words in read.all("script") if "type" not in attributes]
    hashes = {base64.b64encode(hashlib.sha256(words.encode()).digest()).decode() for words in scripts}
    assert set(re.findall(r"'sha256-([^']+)'", policy)) == hashes


def test_equal_results_give_equal_pages(text: str) -> None:
    assert page_text(_page(), _sections()) == text


@pytest.mark.parametrize(("kind", "start"), [("svg", b"<"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_every_figure_becomes_a_file(tmp_path: Path, kind: str, start: bytes) -> None:
    out = tmp_path / "page.html"
    written = write_results_page(out, _page(), _sections(), FigureFiles(tmp_path / "drawn", kind))
    assert [path.name for path in written] == [
        f"figure_01_sine_over_frequency.{kind}",
        f"figure_02_frfs_1_to_1.{kind}",
    ]
    assert all(path.read_bytes().startswith(start) for path in written)
    assert out.exists()


def test_small_panels_look_the_same_as_png(tmp_path: Path) -> None:
    plt = pytest.importorskip("matplotlib.image")
    save_figure(_small(), tmp_path / "panels.png")
    pixels = plt.imread(tmp_path / "panels.png")[:, :, :3]
    assert pixels.shape[1] == pytest.approx(180 / 25.4 * 200, abs=2)
    dark = pixels.max(axis=2) < 0.2
    coloured = (pixels[:, :, 0] > 0.7) & (pixels[:, :, 2] < 0.3)
    assert dark.sum() > 500, "the measured curve and the frames are black"
    assert coloured.sum() > 100, "the fitted curve is coloured"


@pytest.mark.parametrize(
    ("folder", "kind", "words"),
    [("drawn", "tiff", "unknown format 'tiff'"), ("a_file", "svg", "it is a file"), ("no/such", "svg", "is no folder")],
)
def test_a_folder_or_format_that_cannot_be_is_refused(tmp_path: Path, folder: str, kind: str, words: str) -> None:
    (tmp_path / "a_file").write_text("")
    with pytest.raises(InputError, match=words):
        FigureFiles(tmp_path / folder, kind)
