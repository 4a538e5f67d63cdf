"""Puts a flight together: world or hardware, autopilot, vision, record, executive; flies it; takes it apart again."""

from __future__ import annotations

import asyncio
import gc
import time
from collections.abc import Coroutine
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any

from mission.executive.belief import located, surveyed_turbine
from mission.executive.knowledge import Keeping, Knowledge, go_on_from, read_knowledge
from mission.executive.options import FlightOptions, FlightResult
from mission.executive.ready import make_ready, takes_images
from mission.executive.resume import Interrupted, last_of, restore, where
from mission.executive.signals import interrupting
from mission.executive.simulation import Rehearsal
from mission.executive.stage import FlightError, Stage, lockstep_stage, wall_stage

if TYPE_CHECKING:
    from flight.turbine import Turbine
    from mission.executive.executive import Executive
    from mission.executive.journal import Journal
    from mission.record.recorder import RunRecorder

__all__ = ["FlightError", "FlightOptions", "FlightResult", "fly"]

CONNECT_S = 20.0
SIMULATED_LATENCY_S = 0.06  # of capture and vision, in lockstep time, where computing takes no time at all


def fly(options: FlightOptions) -> FlightResult:
    """Fly a mission and write its record (everything except summary and report) into the run's folder.

    Blocks until the machine is in a final state. SIGINT and SIGTERM run the mission's abort path.

    Raises:
        FlightError: nothing was flown (no connection, port in use, rig not there), one line with the remedy.
    """
    from mission.record.folder import RunFolder
    from mission.record.run_log import RunLog

    past = None if options.resume is None else last_of(RunFolder(options.resume), options.mission)
    knowledge = None if past is None or past.folder is None else read_knowledge(past.folder)
    start_s = max(0.0 if past is None else past.t, 0.0 if knowledge is None else knowledge.t)
    log = RunLog(options.folder.log)
    try:
        with (
            lockstep_stage(options, start_s) if options.lockstep else wall_stage(options, start_s) as stage,
            asyncio.Runner(loop_factory=stage.loop_factory) as runner,
        ):
            return runner.run(_fly(options, stage, past, knowledge, log.logger))
    finally:
        log.close()


async def _fly(
    options: FlightOptions, stage: Stage, past: Interrupted | None, knowledge: Knowledge | None, log: Any
) -> FlightResult:
    """Connect, fly, and close everything that was opened, whatever happens."""
    from flight.autopilot import AutopilotError
    from mission.executive.journal import Journal
    from mission.executive.operator import serving
    from mission.record.recorder import RunRecorder

    recorder = journal = None
    tasks: list[asyncio.Task[None]] = []
    try:
        try:
            await stage.autopilot.connect(CONNECT_S)
            if stage.check is not None:
                await stage.check()
            if past is not None and past.ended and stage.autopilot.telemetry.in_air:
                raise FlightError(f"{options.resume}: that run ended ({past.ended}), and the vehicle flies: land it")
            if options.must_confirm and not options.confirm(f"Arm and fly {options.mission.name} for real?"):
                return FlightResult("refused", options.mission.initial, False)
            for name, value in stage.parameters.items():
                await stage.autopilot.set_parameter(name, value)
            looks = takes_images(options.mission)
            if looks and options.lockstep:
                make_ready(stage.world, stage.rig.geometry)
            elif looks:
                await asyncio.to_thread(make_ready, stage.world, stage.rig.geometry)
        except AutopilotError as error:
            raise FlightError(str(error)) from error
        journal = Journal(options.folder.journal, threaded=not options.lockstep)
        recorder = RunRecorder(options.folder, stage.rig.geometry.stereo.left, log, inline=options.lockstep)
        executive, running = _compose(options, stage, journal, recorder, past, knowledge, log)
        loop = asyncio.get_running_loop()
        tasks = [loop.create_task(work, name=name) for name, work in running.items()]
        for task in tasks:
            task.add_done_callback(lambda ended: _watch(ended, executive, log))
        options.on_start(executive)
        listening = nullcontext() if options.lockstep else serving(executive, options.folder.path)
        gc.collect()
        gc.freeze()  # what exists by now stays: looking through it again would stop the setpoints for 0.1 s
        with interrupting(executive):
            async with listening:
                outcome = await executive.run()
        return FlightResult(outcome.outcome, outcome.final_state, outcome.interrupted)
    finally:
        for task in tasks:
            task.cancel()
        with suppress(asyncio.CancelledError):
            for task, ended in zip(tasks, await asyncio.gather(*tasks, return_exceptions=True), strict=True):
                if isinstance(ended, Exception):
                    log.error("task had failed", task=task.get_name(), exc_info=ended)
        await stage.autopilot.close()
        if recorder is not None:
            recorder.close()
        if journal is not None:
            journal.close()


def _watch(task: asyncio.Task[None], executive: Executive, log: Any) -> None:
    """What runs beside the executive ends only by being cancelled; else the flight is no longer what it should be."""
    if task.cancelled():
        return
    error = task.exception()
    text = "it returned" if error is None else f"{type(error).__name__}: {error}".splitlines()[0][:300]
    log.error("task ended", task=task.get_name(), error=text, exc_info=error)
    executive.raise_event("abort", error=f"{task.get_name()} ended: {text}")


def _compose(
    options: FlightOptions,
    stage: Stage,
    journal: Journal,
    recorder: RunRecorder,
    past: Interrupted | None,
    knowledge: Knowledge | None,
    log: Any,
) -> tuple[Executive, dict[str, Coroutine[Any, Any, None]]]:
    """The executive with its services, and what has to run beside it, by name."""
    from flight.keepout import KeepOut
    from flight.setpoints import SetpointStream
    from mission.executive.executive import Executive
    from mission.executive.perception import VisionLoop
    from mission.executive.question import asking
    from mission.executive.services import Services
    from vision.far_view import find_rotor
    from vision.pipeline import Eye
    from vision.tracker import BladeTracker

    executive: Executive
    services: Services
    mission = options.mission
    camera = stage.rig.geometry.stereo.left
    turbine = surveyed_turbine(mission)
    setpoints = SetpointStream(
        stage.autopilot,
        stage.clock,
        KeepOut(turbine, mission.limits.clearance_m),
        on_sent=recorder.sent,
        on_event=lambda name: executive.raise_event(name),
        on_error=lambda error: log.error("setpoint failed", exc_info=error),
        wall=stage.clock.now if options.lockstep else time.monotonic,
    )
    perception = VisionLoop(
        rig=stage.rig,
        eye=Eye(stage.rig.geometry, time.perf_counter),
        find_rotor=lambda image: find_rotor(image, camera, now=time.perf_counter),
        tracker=lambda frame: BladeTracker(frame, camera),
        frame=turbine.blade_frame(),
        autopilot=stage.autopilot,
        clock=stage.clock,
        mount=mission.rig.mount_m,
        sink=recorder,
        pace=stage.pace,
        log=log,
        latency_s=SIMULATED_LATENCY_S if options.lockstep else 0.0,
    )

    def refined(turbine: Turbine) -> None:
        perception.use_frame(turbine.blade_frame())
        assert setpoints.keep_out is not None
        setpoints.keep_out = setpoints.keep_out.with_turbine(turbine)

    services = Services(
        clock=stage.clock,
        autopilot=stage.autopilot,
        setpoints=setpoints,
        perception=perception,
        turbine=turbine,
        mission=mission,
        raise_event=lambda name, **data: executive.raise_event(name, **data),
        log=log,
        rig=stage.rig,
        locate=lambda sights: located(services.turbine, camera, sights),
        on_turbine_refined=refined,
    )
    in_air = stage.autopilot.telemetry.in_air
    if past is not None:
        restore(services, past, in_air=in_air)
        if in_air and knowledge is not None:
            go_on_from(perception, knowledge, stage.clock.now(), stage.clock.speed)
    executive = Executive(
        mission,
        services,
        stage.clock,
        journal,
        ask=asking(options.confirm, at_once=options.lockstep),
        autonomy=options.autonomy,
        resume=None if past is None else where(mission, past, in_air=in_air),
        gone=stage.gone,
    )
    beside: dict[str, Coroutine[Any, Any, None]] = {
        "vision": perception.run(),
        "telemetry": recorder.follow(stage.clock, stage.autopilot, setpoints),
        "knowledge": Keeping(options.folder.path, perception, log, threaded=not options.lockstep).run(stage.clock),
    }
    if stage.world is not None:
        rehearsal = Rehearsal(stage.world, stage.switch, lambda: executive.state, beside=not options.lockstep)
        beside["faults"] = rehearsal.run(stage.clock)
    if stage.pace is not None:
        beside["pace"] = stage.pace.run()
    return executive, beside
