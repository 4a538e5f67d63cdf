"""Guards mean what they say, know nothing but the declared words, and refuse the rest with a place."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.language.conditions import ConditionError, parse
from mission.language.quantities import QUANTITIES, keys

_NAMES = {"armed": "armed", "in_air": "in_air", "tip_known": "tip_known", "pass_done(leading)": "pass_done__leading"}
_ATOMS = st.sampled_from([*_NAMES, "battery_percent > 40", "wind_m_s <= 8.5", "station_m != 0"])
_EXPRESSIONS = st.recursive(
    _ATOMS,
    lambda inner: (
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(lambda parts: f"({' '.join(parts)})")
        | inner.map(lambda part: f"not {part}")
    ),
    max_leaves=8,
)


@given(
    _EXPRESSIONS, st.fixed_dictionaries({name: st.booleans() for name in _NAMES}), st.floats(0, 100), st.floats(0, 20)
)
def test_a_guard_agrees_with_python_on_the_same_words(
    text: str, flags: dict[str, bool], battery: float, wind: float
) -> None:
    values: dict[str, float | bool | None] = {**flags, "battery_percent": battery, "wind_m_s": wind, "station_m": 3.0}
    spelled = {_NAMES.get(name, name): value for name, value in values.items()}
    python = text.replace("pass_done(leading)", "pass_done__leading")
    assert parse(text).evaluate(values) == eval(python, {}, spelled)


@given(_EXPRESSIONS)
def test_nothing_known_makes_no_guard_true_unless_it_is_true_anyway(text: str) -> None:
    assert parse(text).evaluate({}) is False
    assert parse(f"not ({text})").evaluate({}) is False


def test_what_decides_alone_decides_although_the_rest_is_unknown() -> None:
    assert parse("armed or battery_percent > 40").evaluate({"armed": True})
    assert parse("not (armed and battery_percent > 40)").evaluate({"armed": False})
    assert not parse("battery_percent > 40").evaluate({"battery_percent": float("nan")})


@pytest.mark.parametrize(
    ("text", "column", "word"),
    [
        ("baterry_percent > 40", 0, "baterry_percent"),
        ("armed and", 9, "expected"),
        ("armed in_air", 6, "in_air"),
        ("battery_percent", 15, "compare"),
        ("armed > 1", 6, "not compared"),
        ("battery_percent > 140", 18, "decides nothing"),
        ("pass_done", 0, "pass_done(leading)"),
        ("pass_done(both)", 10, "both"),
        ("(armed", 6, "missing"),
        ("armed; import os", 5, "no meaning"),
        ("__import__('os')", 11, "no meaning"),
        ("not " * 30 + "armed", 80, "deep"),
        ("", 0, "expected"),
    ],
)
def test_a_wrong_guard_says_where_and_what(text: str, column: int, word: str) -> None:
    with pytest.raises(ConditionError) as caught:
        parse(text)
    assert caught.value.column == column and word in str(caught.value)


def test_every_declared_word_can_be_used() -> None:
    for key in keys():
        quantity = QUANTITIES[key.partition("(")[0]]
        text = key if quantity.is_condition else f"{key} > {max(quantity.low, 0.0):g}"
        assert parse(text).names == (key,)
