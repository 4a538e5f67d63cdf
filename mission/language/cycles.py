"""Cycles and longest paths in a graph of steps."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import TypeVar

N = TypeVar("N", bound=Hashable)


def components(nodes: Iterable[N], after: Mapping[N, Iterable[N]]) -> list[list[N]]:
    """Strongly connected components, each after those it leads to (Tarjan, without recursion)."""
    index: dict[N, int] = {}
    low: dict[N, int] = {}
    on_stack: set[N] = set()
    stack: list[N] = []
    found: list[list[N]] = []
    for root in nodes:
        if root in index:
            continue
        index[root] = low[root] = len(index)
        stack.append(root)
        on_stack.add(root)
        work = [(root, iter(after.get(root, ())))]
        while work:
            node, targets = work[-1]
            for target in targets:
                if target not in index:
                    index[target] = low[target] = len(index)
                    stack.append(target)
                    on_stack.add(target)
                    work.append((target, iter(after.get(target, ()))))
                    break
                if target in on_stack:
                    low[node] = min(low[node], index[target])
            else:
                work.pop()
                if work:
                    parent = work[-1][0]
                    low[parent] = min(low[parent], low[node])
                if low[node] == index[node]:
                    component: list[N] = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        component.append(member)
                        if member == node:
                            break
                    found.append(component)
    return found


def cyclic(component: list[N], after: Mapping[N, Iterable[N]]) -> bool:
    """Whether a component has a cycle: several nodes, or one that leads to itself."""
    return len(component) > 1 or component[0] in set(after.get(component[0], ()))


def shortest_cycle(start: N, within: Iterable[N], after: Mapping[N, Iterable[N]]) -> list[N]:
    """The shortest way from a node back to itself inside a component, the node at both ends."""
    inside = set(within)
    came: dict[N, N] = {}
    waiting = [start]
    for here in waiting:
        for target in after.get(here, ()):
            if target == start:
                node = here
                back = [start]
                while node != start:
                    back.append(node)
                    node = came[node]
                return [start, *reversed(back)]
            if target in inside and target not in came:
                came[target] = here
                waiting.append(target)
    return [start]


def longest(
    nodes: Iterable[N], after: Mapping[N, Iterable[N]], weight: Callable[[N], float]
) -> dict[N, tuple[float, N | None]]:
    """For each node of a graph without cycles the heaviest path from it: its weight and the next node on it."""
    best: dict[N, tuple[float, N | None]] = {}
    for component in components(nodes, after):
        node = component[0]
        heaviest: tuple[float, N | None] = (0.0, None)
        for target in after.get(node, ()):
            if target != node and target in best and (heaviest[1] is None or best[target][0] > heaviest[0]):
                heaviest = (best[target][0], target)
        best[node] = (weight(node) + heaviest[0], heaviest[1])
    return best
