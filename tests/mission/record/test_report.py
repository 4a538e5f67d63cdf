"""report.html is one page that needs nothing else, for every run there may be."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import pytest

from mission.record.folder import RunFolder, create
from mission.record.report import write_report
from mission.record.summary import write_summary
from tests.mission.record.synthetic_run import MISSION, flown, fly, write_journal

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Collects what a browser would load, and whether every element is closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.balanced = True
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.loads += [value or "" for name, value in attrs if name in ("src", "href") and tag != "a"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        self.balanced &= bool(self.open) and self.open.pop() == tag


def page_of(folder: RunFolder) -> tuple[str, Page]:
    text = write_report(folder, write_summary(folder)).read_text("utf-8")
    return text, Page(text)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Page]:
    return page_of(flown(tmp_path_factory.mktemp("logs"), skip=(18.0, 24.0)))


def test_the_page_loads_nothing_from_anywhere(flight: tuple[str, Page]) -> None:
    _, page = flight
    assert page.loads
    assert all(source.startswith("data:image/jpeg;base64,") for source in page.loads)
    assert "script" not in page.tags


def test_the_page_is_well_formed(flight: tuple[str, Page]) -> None:
    _, page = flight
    assert page.balanced
    assert page.open == []


def test_the_page_shows_states_standoff_both_sides_and_why_cycles_were_refused(flight: tuple[str, Page]) -> None:
    text, page = flight
    assert page.tags.count("svg") == 4
    assert page.tags.count("img") == 24
    for words in ("inspect.leading", "Standoff while following", "Leading side", "Trailing side", "too few dots"):
        assert words in text


def test_a_killed_run_has_a_page_too(tmp_path: Path) -> None:
    folder = create(tmp_path, "v80_blade", MISSION)
    fly(folder, until_s=80.0)
    write_journal(folder, until_s=70.0)
    text, page = page_of(folder)
    assert page.balanced
    assert "unfinished" in text
    assert "Trailing side" not in text


def test_a_run_that_never_took_off_has_a_page_too(tmp_path: Path) -> None:
    _, page = page_of(create(tmp_path, "v80_blade", MISSION))
    assert page.balanced


def test_words_from_files_cannot_become_part_of_the_page(tmp_path: Path) -> None:
    folder = create(tmp_path, "v80", MISSION.replace("v80_blade", '"<script>alert(1)</script>"'))
    folder.journal.write_text(
        '{"seq": 0, "t": 0.0, "kind": "start", "state": "<img src=x onerror=y>"}\n'
        '{"seq": 1, "t": 1.0, "kind": "end", "outcome": "<b>", "state": "x"}\n'
    )
    text, page = page_of(folder)
    assert "script" not in page.tags
    assert page.loads == []
    assert "&lt;script&gt;" in text


def test_lost_pictures_leave_the_rest_of_the_page(tmp_path: Path) -> None:
    folder = flown(tmp_path)
    for path in folder.frames.glob("*.jpg"):
        path.unlink()
    _, page = page_of(folder)
    assert page.balanced
    assert page.loads == []
