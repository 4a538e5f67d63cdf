"""Guards: a tiny grammar over the closed vocabulary of quantities. Parsed, never executed.

condition = conjunction {"or" conjunction}
conjunction = negation {"and" negation}
negation = "not" negation | "(" condition ")" | comparison | name ["(" argument ")"]
comparison = name ("<" | "<=" | ">" | ">=" | "==" | "!=") number
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from mission.language.quantities import QUANTITIES, Quantity

Values = Mapping[str, float | bool | None]
_Evaluate = Callable[[Values], bool | None]

_OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
_TOKEN = re.compile(r"\s*(?:(?P<number>[-+]?\d+(?:\.\d+)?)|(?P<name>[A-Za-z_][\w.]*)|(?P<sign><=|>=|==|!=|<|>|\(|\)))")
_LONGEST = 400
_DEEPEST = 20


class ConditionError(ValueError):
    """A guard that cannot be understood. `column` is the offset in its text; `unknown` is a name that is not known."""

    def __init__(self, message: str, column: int, unknown: str = "", known: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.column = column
        self.unknown = unknown
        self.known = known


@dataclass(frozen=True)
class Condition:
    """A guard. Two are equal when their text is. `names` are the keys that it looks up."""

    text: str
    names: tuple[str, ...] = field(compare=False, default=())
    _evaluate: _Evaluate = field(compare=False, repr=False, default=lambda values: None)

    def evaluate(self, values: Values) -> bool:
        """Whether it is known to be true: what is missing or None is unknown, and unknown parts do not make it true."""
        return self._evaluate(values) is True

    def __str__(self) -> str:
        return self.text


def parse(text: str, vocabulary: Mapping[str, Quantity] = QUANTITIES) -> Condition:
    """Read a guard, or another statement over a vocabulary of its own.

    Raises:
        ConditionError: it breaks the grammar, uses a name outside the vocabulary, or compares with a value that the
            quantity can never pass.
    """
    return _Parser(text, vocabulary).parse()


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    column: int


class _Parser:
    def __init__(self, text: str, vocabulary: Mapping[str, Quantity]) -> None:
        if len(text) > _LONGEST:
            raise ConditionError(f"a condition may have {_LONGEST} characters at most", 0)
        self.text = text
        self.vocabulary = vocabulary
        self.tokens = list(_tokens(text))
        self.position = 0
        self.depth = 0
        self.names: list[str] = []

    def parse(self) -> Condition:
        evaluate = self.disjunction()
        if self.next.kind != "end":
            raise ConditionError(f"{self.next.text!r} does not belong here", self.next.column)
        return Condition(" ".join(self.text.split()), tuple(dict.fromkeys(self.names)), evaluate)

    @property
    def next(self) -> _Token:
        return self.tokens[self.position]

    def accept(self, *texts: str) -> _Token | None:
        token = self.next
        if token.text in texts and token.kind != "end":
            self.position += 1
            return token
        return None

    def disjunction(self) -> _Evaluate:
        parts = [self.conjunction()]
        while self.accept("or"):
            parts.append(self.conjunction())
        return parts[0] if len(parts) == 1 else lambda values: _any(part(values) for part in parts)

    def conjunction(self) -> _Evaluate:
        parts = [self.negation()]
        while self.accept("and"):
            parts.append(self.negation())
        if len(parts) == 1:
            return parts[0]
        return lambda values: _inverted(_any(_inverted(part(values)) for part in parts))

    def negation(self) -> _Evaluate:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise ConditionError("a condition may be nested 20 deep at most", self.next.column)
        try:
            if self.accept("not"):
                inner = self.negation()
                return lambda values: _inverted(inner(values))
            if self.accept("("):
                inner = self.disjunction()
                self.close("(")
                return inner
            return self.atom()
        finally:
            self.depth -= 1

    def close(self, opened: str) -> None:
        if not self.accept(")"):
            raise ConditionError(f"a ')' for the {opened!r} is missing", self.next.column)

    def atom(self) -> _Evaluate:
        token = self.next
        if token.kind != "name" or token.text in ("and", "or", "not"):
            wanted = "the name of a quantity or condition is expected"
            raise ConditionError(f"{wanted}, not {token.text!r}" if token.text else f"{wanted} here", token.column)
        self.position += 1
        quantity = self.vocabulary.get(token.text)
        if quantity is None:
            raise ConditionError(
                f"{token.text!r} is not a quantity or condition", token.column, token.text, tuple(self.vocabulary)
            )
        key = self.argument(quantity, token)
        self.names.append(key)
        if quantity.is_condition:
            if self.next.text in _OPERATORS:
                raise ConditionError(f"{quantity.name} is a yes or no and is not compared", self.next.column)
            return lambda values: _truth(values.get(key))
        return self.comparison(quantity, key)

    def argument(self, quantity: Quantity, token: _Token) -> str:
        if not self.accept("("):
            if quantity.arguments:
                wanted = " or ".join(f"{quantity.name}({argument})" for argument in quantity.arguments[:3])
                raise ConditionError(f"{quantity.name} needs to be told of what: {wanted}", token.column)
            return quantity.name
        inner = self.next
        if inner.text not in quantity.arguments:
            known = ", ".join(quantity.arguments[:6]) or "nothing"
            raise ConditionError(
                f"{quantity.name}(…) may be asked for {known}, not {inner.text!r}",
                inner.column,
                inner.text if quantity.arguments else "",
                quantity.arguments,
            )
        self.position += 1
        self.close("(")
        return f"{quantity.name}({inner.text})"

    def comparison(self, quantity: Quantity, key: str) -> _Evaluate:
        sign = self.accept(*_OPERATORS)
        if sign is None:
            raise ConditionError(
                f"{quantity.name} is a number in {quantity.unit}: compare it, as in '{quantity.name} > 1'",
                self.next.column,
            )
        token = self.next
        if token.kind != "number":
            raise ConditionError(f"a number is expected after {sign.text!r}, not {token.text!r}", token.column)
        self.position += 1
        number = float(token.text)
        if not quantity.low <= number <= quantity.high:
            raise ConditionError(
                f"{quantity.name} is always between {quantity.low:g} and {quantity.high:g} {quantity.unit}: "
                f"comparing it with {token.text} decides nothing",
                token.column,
            )
        compare = _OPERATORS[sign.text]

        def evaluate(values: Values) -> bool | None:
            value = values.get(key)
            return None if value is None or value != value else compare(float(value), number)

        return evaluate


def _tokens(text: str) -> Iterator[_Token]:
    position = 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None:
            column = position + len(text[position:]) - len(text[position:].lstrip())
            raise ConditionError(f"{text[column]!r} has no meaning in a condition", column)
        kind = str(match.lastgroup)
        yield _Token(kind, match.group(kind), match.start(kind))
        position = match.end()
    yield _Token("end", "", len(text))


def _truth(value: float | bool | None) -> bool | None:
    return None if value is None else bool(value)


def _inverted(value: bool | None) -> bool | None:
    return None if value is None else not value


def _any(values: Iterator[bool | None]) -> bool | None:
    unknown = False
    for value in values:
        if value:
            return True
        unknown = unknown or value is None
    return None if unknown else False
