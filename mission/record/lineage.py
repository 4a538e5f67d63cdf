"""Runs that go on with one another: what each says of the one before it, and all of them in order."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, ValidationError

from mission.record.folder import RunFolder

NOTE = "run.json"


class RunNote(BaseModel):
    """How a run was begun, as far as going on with it needs to know. continues: folder of the run before it, by its
    name where both lie side by side. system, speed: None for the rig file's own."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    continues: str | None = None
    system: str | None = None
    speed: float | None = None
    lockstep: bool = False

    def write(self, folder: RunFolder) -> None:
        """Put it into the run's folder, whole.

        Raises:
            OSError: it cannot be written.
        """
        draft = folder.path / (NOTE + ".part")
        draft.write_text(self.model_dump_json() + "\n", "utf-8")
        draft.replace(folder.path / NOTE)


def note_of(folder: RunFolder) -> RunNote:
    """What a run's folder says; where it says nothing, a run of its own."""
    try:
        return RunNote.model_validate_json((folder.path / NOTE).read_text("utf-8"))
    except (OSError, ValidationError, UnicodeDecodeError):
        return RunNote()


def reference(to: RunFolder, seen_from: RunFolder) -> str:
    """How one run's folder is named in another's note."""
    there, here = to.path.resolve(), seen_from.path.resolve()
    return there.name if there.parent == here.parent else str(there)


def lineage(folder: RunFolder) -> tuple[RunFolder, ...]:
    """The runs that this one goes on with, oldest first, itself last. One that has been removed ends the row."""
    found = [folder]
    seen = {folder.path.resolve()}
    while (before := note_of(found[0]).continues) is not None:
        path = found[0].path.resolve().parent / before
        if path.resolve() in seen or not (path / "mission.yaml").is_file():
            break
        seen.add(path.resolve())
        found.insert(0, RunFolder(path))
    return tuple(found)


def last_of_row(folder: RunFolder) -> RunFolder:
    """The newest of the runs beside this one that go on with it and did anything; itself where none does."""
    beside = folder.path.resolve().parent
    after: dict[str, RunFolder] = {}
    for path in sorted(beside.glob(f"*/{NOTE}")):
        run = RunFolder(path.parent)
        continues = note_of(run).continues
        if continues is not None and not untouched(run):
            after[(beside / continues).resolve().name] = run
    seen, last = {folder.name}, folder
    while (following := after.get(last.name)) is not None and following.name not in seen:
        seen.add(following.name)
        last = following
    return last


def untouched(folder: RunFolder) -> bool:
    """Whether a run was begun, and cut off before it could do anything: no setpoint was sent, nothing was found out,
    no picture was taken."""
    traces = [folder.summary, folder.path / "knowledge.json"]
    try:
        begun = b"run_created" in folder.log.read_bytes()
        setpoints = folder.telemetry / "setpoints.csv"
        sent = setpoints.exists() and setpoints.read_bytes().count(b"\n") > 1
        pictures = any(path.stat().st_size for path in folder.frames.iterdir())
    except OSError:
        return False
    return begun and not (sent or pictures or any(path.exists() for path in traces))
