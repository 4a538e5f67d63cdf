"""Where a run went, from its journal."""

from __future__ import annotations

from pathlib import Path

from mission.language.diagram.parts import Painting, Visit
from mission.language.document import Mission, enclosing


def painting(mission: Mission, run: Path) -> Painting:
    """Read a run's folder, and those of the runs that it goes on with.

    Raises:
        JournalError: it has no readable journal.
    """
    from mission.executive.journal import read_journal
    from mission.record.folder import RunFolder
    from mission.record.lineage import lineage

    visits: dict[str, Visit] = {}
    taken: dict[str, int] = {}
    *before, last = (part.journal for part in lineage(RunFolder(run)))
    for journal in (*(path for path in before if path.exists()), last):
        entries = read_journal(journal)
        leaf, since = mission.leaf(mission.initial), 0.0
        for entry in entries:
            if entry.kind == "start":
                leaf, since = str(entry.fields.get("state", leaf)), entry.t
            if entry.kind == "transition":
                key = str(entry.fields["key"])
                taken[key] = taken.get(key, 0) + 1
                target = str(entry.fields["to"])
                _visited(visits, leaf, entry.t - since, staying=set(enclosing(target)) - {leaf})
                leaf, since = target, entry.t
        if entries:
            _visited(visits, leaf, entries[-1].t - since, staying=set())
    return Painting(run.resolve().name, visits, taken)


def _visited(visits: dict[str, Visit], leaf: str, seconds: float, staying: set[str]) -> None:
    """Add a stay; one in a composite is over when the way leads out of it."""
    for path in enclosing(leaf):
        before = visits.get(path, Visit(0, 0.0))
        visits[path] = Visit(before.times + (path not in staying), before.seconds + seconds)
