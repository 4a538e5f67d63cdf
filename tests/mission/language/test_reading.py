"""Text becomes a tree with places; what is wrong is reported at its own line and column."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from mission.language.tree import plain
from mission.language.yaml_text import UnreadableError, parse, scalar_value
from tests.mission.language.missions import SMALL, examined, folder, line_of, only, written


@pytest.mark.parametrize(
    ("text", "line", "column", "code"),
    [
        ("a: 1\nb: {c: 1\nd: 2\n", 2, 4, "M002"),
        ("a: 1\nb: 'never closed\n", 2, 4, "M002"),
        ("a: 1\nb 2\nc: 3\n", 2, 1, "M002"),
        ("a: 1\n\tb: 2\n", 2, 1, "M003"),
        ("a: 1\nb: {c: 1, c: 2}\n", 2, 11, "M004"),
        ("a: 1\nb: !!python/object:os.system x\n", 2, 4, "M005"),
        ("a: 1\nb: &x [*x]\n", 2, 8, "M006"),
        ("a: 1\nb: x\x1b[2J\n", 2, 5, "M007"),
        ("a: 1\nb: \u202ereversed\n", 2, 4, "M007"),
        ("a: 1\nb: *gone\n", 2, 4, "M008"),
        ("a: 1\n---\nb: 2\n", 2, 1, "M002"),
        ("- 1\n", 1, 1, "M002"),
        ("", 1, 1, "M002"),
    ],
)
def test_broken_text_is_reported_where_it_breaks(text: str, line: int, column: int, code: str) -> None:
    problems = []
    try:
        parse(text, "file", problems)
    except UnreadableError as error:
        problems.append(error.diagnostic)
    assert [(found.location.line, found.location.column, found.code) for found in problems] == [(line, column, code)]


def test_words_that_old_yaml_took_for_yes_and_no_are_words() -> None:
    assert plain(parse("on: {off: no, y: yes}\n", "file", [])) == {"on": {"off": "no", "y": "yes"}}


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(10**15), 10**15) | st.floats(allow_nan=False, allow_infinity=False),
        lambda inner: (
            st.lists(inner, max_size=4) | st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), inner)
        ),
        max_leaves=20,
    )
)
def test_what_a_yaml_writer_wrote_is_read_back(value: object) -> None:
    assert plain(parse(yaml.safe_dump({"value": value}), "file", [])) == {"value": value}


def test_numbers_are_numbers_and_everything_else_is_text() -> None:
    assert [scalar_value(text) for text in ("7", "-7.5", "1e3", ".5", "true", "~", "1_000", "12:30", "0x1F")] == [
        7, -7.5, 1000.0, 0.5, True, None, "1_000", "12:30", "0x1F",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "text",
    [
        "a: &a [x, x, x, x, x, x, x, x, x]\n"
        + "".join(f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 9)}]\n" for i in range(12)),
        "a: " + "[" * 100_000,
        "a: " + "{a: " * 50_000,
        "a: b\n" * 200_000,
        "a: [" + "1, " * 100_000 + "1]\n",
        "mission: x\n" + "".join(f"k{i}: &a{i} {{<<: *a{i - 1}}}\n" for i in range(1, 3000)),
        "a: &a {<<: *a}\n",
    ],
    ids=["laughs", "deep-lists", "deep-tables", "large", "long-list", "merge-chain", "merge-itself"],
)
def test_hostile_text_is_refused_without_effort(tmp_path: Path, text: str) -> None:
    started = time.process_time()
    examination = examined(tmp_path, text)
    assert examination.errors and examination.mission is None
    assert len(examination.diagnostics) < 10_000
    assert time.process_time() - started < 20  # minutes or gigabytes where it is not refused


def test_a_device_a_folder_and_a_missing_file_are_one_line_each(tmp_path: Path) -> None:
    from mission.language.loading import examine

    for path, word in ((Path("/dev/zero"), "not a plain file"), (tmp_path, "folder"), (tmp_path / "no.yaml", "exist")):
        finding = only(examine(path))
        assert finding.code == "M001" and word in finding.message and str(finding).count("\n") == 0


def test_text_that_is_not_utf_8_names_the_line(tmp_path: Path) -> None:
    path = written(tmp_path, "")
    path.write_bytes(b"mission: a\ntext: \xff\n")
    from mission.language.loading import examine

    finding = only(examine(path))
    assert (finding.code, finding.location.line, finding.location.column) == ("M001", 2, 7)


def test_a_path_may_not_leave_the_missions_folder(tmp_path: Path) -> None:
    (tmp_path / "secret.yaml").write_text("name: secret\n")
    missions = folder(tmp_path)
    (missions / "sites" / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    for path in ("../secret.yaml", "/etc/passwd", "sites/link.yaml", "turbines/../../secret.yaml"):
        text = SMALL.replace("sites/coast.yaml", path)
        examination = examined(tmp_path, text)
        found = [finding for finding in examination.diagnostics if finding.code == "M103"]
        assert [finding.location.line for finding in found] == [line_of(text, "site:")], path
        assert not any("secret" in finding.message and finding.code != "M103" for finding in examination.diagnostics)


def test_a_missing_file_is_blamed_on_the_line_that_names_it(tmp_path: Path) -> None:
    text = SMALL.replace("turbines/v80.yaml", "turbines/v81.yaml")
    finding = only(examined(tmp_path, text))
    assert (finding.code, finding.location.line) == ("M101", 3) and "v80.yaml" in finding.hint


def test_control_characters_in_names_do_not_reach_the_terminal(tmp_path: Path) -> None:
    text = SMALL.replace("done: work", '"do\\u001b[31mne": work')
    examination = examined(tmp_path, text)
    assert examination.errors
    assert all(str(finding).isprintable() for finding in examination.diagnostics)


@pytest.mark.parametrize("name", ["a" * 5000, "a/" * 3000 + "b", "sites", ".", "file:///etc/passwd", "~", "[x]", "7"])
def test_a_name_that_is_no_file_is_one_readable_line(tmp_path: Path, name: str) -> None:
    text = SMALL.replace("turbines/v80.yaml", name)
    examination = examined(tmp_path, text)
    assert examination.errors and {finding.location.line for finding in examination.errors} == {3}
    assert all(len(str(finding)) < 2000 and "\n" not in str(finding) for finding in examination.diagnostics)


def test_a_command_line_that_is_no_file_is_one_readable_line() -> None:
    from mission.language.loading import examine

    for path in ("a" * 5000, "x\0y", "", "/proc/self/mem"):
        finding = only(examine(Path(path)))
        assert finding.code == "M001" and str(finding).isprintable() and len(str(finding)) < 2000
