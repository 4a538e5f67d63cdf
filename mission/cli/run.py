"""Fly a mission: the main job."""

from __future__ import annotations

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.cli.errors import ABORTED, INTERRUPTED, OUTCOME_CODES, REFUSED, CommandError
from mission.cli.going_on import as_before, interrupted_run

if TYPE_CHECKING:
    from mission.cli.live import View
    from mission.executive.assembly import FlightResult
    from mission.language.document import Mission
    from mission.record.folder import RunFolder


class Autonomy(StrEnum):
    """How much is asked before a transition is taken."""

    FULL = "full"
    CONFIRM = "confirm"
    MANUAL = "manual"


def run(
    file: Annotated[
        Path | None, typer.Argument(help="The mission; with --resume, the one that was interrupted.")
    ] = None,
    rig: Annotated[str | None, typer.Option(help="Another rig file: the same mission elsewhere.")] = None,
    system: Annotated[
        str | None, typer.Option(metavar="URL", help="Another vehicle, such as udpin://0.0.0.0:14540.")
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Override a value of the resolved mission; repeat it."),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=0.1, max=100.0, help="Mission seconds per wall second, in simulation.")
    ] = None,
    lockstep: Annotated[bool, typer.Option("--lockstep", help="Simulate in one process, the same every time.")] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Plain lines instead of the live view.")] = False,
    resume: Annotated[
        Path | None, typer.Option(metavar="RUN", help="Go on with an interrupted run: its folder, name or `latest`.")
    ] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Arm a real vehicle without asking.")] = False,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Another wind, noise and drift of the simulated world.")
    ] = None,
    autonomy: Annotated[
        Autonomy, typer.Option(help="full: never ask. confirm: ask where the mission says so. manual: ask always.")
    ] = Autonomy.FULL,
) -> None:
    """Fly a mission to its end and leave its record in a folder below `logs`.

    In a terminal a live view shows the state, its deadline, the metres along the blade, what comes next and what blocks
    it. Keys: p pause, r resume, s step, a abort. Ctrl-C runs the mission's abort path: back off, climb, home, land.

    \b
    Examples:
      mission run missions/v80_blade.yaml
      mission run missions/v80_blade.yaml --set turbine.azimuth_deg=180 --speed 2
      mission run missions/v80_blade.yaml --set world.faults.images.every_s=20 --headless
      mission run missions/v80_blade.yaml --rig missions/rigs/px4_sitl.yaml
      mission run --resume latest

    A real vehicle is armed only after an explicit yes: in the terminal, or --yes in scripts. A simulated one flies.
    """
    resumed = interrupted_run(resume, record)
    if resumed is not None:
        speed, system, lockstep = as_before(resumed, speed, system, lockstep)
    overrides = list(changes or []) + ([f"world.seed={seed}"] if seed is not None else [])
    mission = _mission(file, resumed, overrides, rig)
    if resumed is not None:
        from mission.executive.resume import last_of

        last_of(resumed, mission)  # refuse what cannot be gone on with before a folder is made
    must_confirm = _may_fly(mission, speed=speed, lockstep=lockstep, system=system, yes=yes)

    from mission.record.folder import NEEDED_MB, NEEDED_WITHOUT_FRAMES_MB, create
    from mission.record.lineage import RunNote, reference

    needed_mb = NEEDED_MB if _takes_frames(mission) else NEEDED_WITHOUT_FRAMES_MB
    folder = create(record, mission.name, mission.resolved_yaml, needed_mb)
    RunNote(
        continues=reference(resumed, folder) if resumed else None, system=system, speed=speed, lockstep=lockstep
    ).write(folder)
    result, view = _fly(
        mission,
        folder,
        headless=headless,
        yes=yes,
        options={
            "speed": speed,
            "lockstep": lockstep,
            "system": system,
            "must_confirm": must_confirm,
            "autonomy": str(autonomy),
            "resume": resumed.path if resumed else None,
        },
    )
    view.close()
    _close(folder, result)
    raise typer.Exit(INTERRUPTED if result.interrupted else OUTCOME_CODES.get(result.outcome, ABORTED))


def _mission(file: Path | None, resumed: RunFolder | None, overrides: list[str], rig: str | None) -> Mission:
    if file is None and resumed is None:
        raise CommandError("run: name a mission file, such as missions/v80_blade.yaml (see `mission run --help`)")
    from mission.language.document import load

    return load(file if file is not None else resumed.mission, overrides, rig)  # type: ignore[union-attr]


def _may_fly(mission: Mission, *, speed: float | None, lockstep: bool, system: str | None, yes: bool) -> bool:
    """Refuse at once what could only fail later; return whether a person must say yes before arming."""
    from mission.executive.connection import EMBEDDED, is_simulated, must_confirm

    if lockstep:
        _may_lockstep(mission, speed, system)
    if system is not None and system != EMBEDDED:
        _well_formed(system)
    where = EMBEDDED if lockstep else system
    if speed not in (None, 1.0) and not is_simulated(mission.rig, where):
        raise CommandError(f"run: --speed {speed:g}: a real vehicle flies at speed 1")
    asks = must_confirm(mission.rig, where)
    if asks and not yes and not _interactive():
        raise CommandError("run: a real vehicle is armed only after a yes: answer in a terminal, or give --yes")
    return asks


def _takes_frames(mission: Mission) -> bool:
    from mission.executive.ready import FRAMING

    return any(state.do in FRAMING for state in mission.states.values())


def _may_lockstep(mission: Mission, speed: float | None, system: str | None) -> None:
    if mission.rig.kind != "simulated":
        raise CommandError(f"run: --lockstep needs a rig of kind simulated, and this one is {mission.rig.kind}")
    for flag, given in (("--speed", speed), ("--system", system)):
        if given is not None:
            raise CommandError(f"run: --lockstep is for the embedded simulator, as fast as it goes: leave out {flag}")


def _well_formed(system: str) -> None:
    from flight.autopilot import AutopilotError
    from flight.udp_port import check_form

    try:
        check_form(system)
    except AutopilotError as error:
        raise CommandError(f"run: --system: {error}") from None


def _interactive() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty()


def _fly(
    mission: Mission, folder: RunFolder, *, headless: bool, yes: bool, options: dict[str, Any]
) -> tuple[FlightResult, View]:
    """Fly with a view; a run that never began leaves no folder behind."""
    from mission.cli.live import open_view
    from mission.executive.assembly import FlightError, FlightOptions, fly

    view = open_view(mission, folder, headless=headless or not _interactive() or os.environ.get("TERM") == "dumb")
    try:
        result = fly(
            FlightOptions(
                mission=mission,
                folder=folder,
                confirm=(lambda question: True) if yes else view.ask,
                on_start=view.start,
                **options,
            )
        )
    except Exception as error:
        view.close()
        if isinstance(error, FlightError):
            _discard_if_empty(folder)
            raise
        raise CommandError(_crashed(folder, error), ABORTED) from error
    except BaseException:
        view.close()
        _discard_if_empty(folder)
        raise
    return result, view


def _discard_if_empty(folder: RunFolder) -> None:
    """Remove the folder of a run that never began; one with a journal stays."""
    import shutil

    if not folder.journal.exists() or folder.journal.stat().st_size == 0:
        shutil.rmtree(folder.path, ignore_errors=True)


def _crashed(folder: RunFolder, error: Exception) -> str:
    import traceback

    from mission.cli.errors import one_line

    path = folder.path / "error.txt"
    try:
        path.write_text("".join(traceback.format_exception(error)), "utf-8")
    except OSError:
        path = folder.path
    return f"unexpected error, please report it: {type(error).__name__}: {one_line(error)}; details in {path}"


def _close(folder: RunFolder, result: FlightResult) -> None:
    """Compute and print what the run came to. How it ended is the exit code, whatever becomes of the report."""
    from mission.cli.errors import one_line
    from mission.cli.report import rebuild, told
    from mission.record.folder import log_line

    if not folder.journal.exists():
        _discard_if_empty(folder)
        raise CommandError("nothing was flown: the vehicle is not armed without a yes", REFUSED)
    try:
        log_line(folder, "run_ended", outcome=result.outcome, interrupted=result.interrupted)
        lines = told(folder, rebuild(folder))
    except Exception as error:
        again = f"`mission report {folder.path}` tries again"
        print(f"{result.outcome} in {result.final_state}", flush=True)
        print(f"mission: no report: {type(error).__name__}: {one_line(error)}; {again}", file=sys.stderr)
        return
    for line in lines:
        print(line)
