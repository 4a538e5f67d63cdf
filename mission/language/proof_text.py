"""A proof as text for people and as data for machines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from mission.language import sources
from mission.language.endings import Failure
from mission.language.exploration import Edge
from mission.language.proof import EventProof, Proof


def shown(proof: Proof, traces: bool = False) -> str:
    """The report. traces: the longest way of each event, too."""
    return "\n".join(_lines(proof, traces))


def _lines(proof: Proof, traces: bool) -> Iterator[str]:
    mission = proof.mission
    file = sources.shown(mission.path)
    yield (
        f"{mission.name}: {proof.situations} situations, {proof.steps} steps explored; "
        f"{len(proof.events)} safety events in every airborne situation, guards free"
    )
    width = max((len(one.event.name) for one in proof.events), default=0)
    yield f"  {'holds' if not proof.failures else 'FAILS'}  every way ends"
    for failure in proof.failures:
        yield f"         M401 {failure.kind}: {failure.message}"
        yield from _trace(failure.trace, file)
    told: dict[tuple[str, ...], str] = {}
    for one in proof.events:
        yield f"  {'holds' if not one.failures else 'FAILS'}  {one.event.name.ljust(width)}  {_measure(one)}"
        for failure in one.failures:
            yield f"         M401 {failure.kind}: {failure.message}"
            way = tuple(_trace(failure.trace, file))
            first = told.setdefault(way, one.event.name)
            yield from way if first == one.event.name else [f"           the way there is that of {first}"]
        if traces and one.longest is not None and not one.failures:
            yield from _trace(one.longest.trace, file)
    for stated in proof.invariants:
        what = f"{stated.invariant.kind}: {stated.invariant.statement}"
        yield f"  {'holds' if stated.failure is None else 'FAILS'}  {what}"
        if stated.failure is not None:
            yield f"         {stated.invariant.location}: M402 {stated.failure.message}"
            yield from _trace(stated.failure.trace, file)
    for assumption in proof.assumptions:
        yield f"  given that {assumption}"
    yield f"{mission.name}: {'proven' if proof.holds else 'NOT proven'}"


def _measure(one: EventProof) -> str:
    if one.longest is None:
        return f"{one.situations} situations"
    seconds = f"{one.longest.seconds:.0f} s" if one.longest.seconds < float("inf") else "no known time"
    return f"{one.situations} situations, safe end after at most {one.longest.steps} transitions and {seconds}"


def _trace(trace: Sequence[Edge], file: str) -> Iterator[str]:
    if trace:
        yield f"           {trace[0].source.leaf}"
    for edge in trace:
        yield f"             {edge.event} → {edge.target.leaf}{_where(edge, file)}"


def _where(edge: Edge, file: str) -> str:
    if edge.event == "skip":
        return "   [by the operator]"
    asked = [f"when {edge.transition.when}"] if edge.transition.when is not None else []
    asked += [f"unless {edge.transition.unless}"] if edge.transition.unless is not None else []
    via = f", as {edge.transition.event}" if edge.transition.event != edge.event else ""
    return f"   [{edge.transition.location.seen_from(file)}{via}{'; ' if asked else ''}{' '.join(asked)}]"


def data(proof: Proof) -> dict[str, Any]:
    """For `--json`."""
    return {
        "mission": proof.mission.name,
        "proven": proof.holds,
        "situations": proof.situations,
        "steps": proof.steps,
        "assumptions": list(proof.assumptions),
        "failures": [_failure(failure) for failure in proof.failures],
        "events": [
            {
                "event": one.event.name,
                "severity": str(one.event.severity),
                "situations": one.situations,
                "longest_transitions": one.longest.steps if one.longest else None,
                "longest_s": one.longest.seconds if one.longest and one.longest.seconds < float("inf") else None,
                "failures": [_failure(failure) for failure in one.failures],
            }
            for one in proof.events
        ],
        "invariants": [
            {
                "kind": one.invariant.kind,
                "statement": one.invariant.statement.text,
                "holds": one.failure is None,
                "failure": _failure(one.failure) if one.failure is not None else None,
            }
            for one in proof.invariants
        ],
    }


def _failure(failure: Failure) -> dict[str, Any]:
    steps = [
        {
            "from": edge.source.leaf,
            "event": edge.event,
            "to": edge.target.leaf,
            "file": edge.transition.location.file,
            "line": edge.transition.location.line,
        }
        for edge in failure.trace
    ]
    code = "M402" if failure.kind == "invariant" else "M401"
    return {"code": code, "kind": failure.kind, "message": failure.message, "trace": steps}
