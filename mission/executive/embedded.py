"""The embedded simulator's vehicle: started for this flight, or taken up from the run that is gone on with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mission.executive.stage import FlightError

if TYPE_CHECKING:
    from devices.vehicle.handover import RunningVehicle, VehicleNote
    from devices.vehicle.spawn import VehicleProcess
    from mission.executive.options import FlightOptions


def embedded_vehicle(options: FlightOptions, speed: float) -> RunningVehicle:
    """A vehicle that lives as long as this process, and a while longer; the folder says where it is found then.

    Raises:
        FlightError: it cannot be started, or the run to go on with is still being flown.
    """
    return _taken_up(options, speed) or _spawn(options, speed)


def _taken_up(options: FlightOptions, speed: float) -> RunningVehicle | None:
    """The vehicle of the run that is gone on with, if it is still there: in the air, or where it came down."""
    from devices.vehicle.handover import StillFlownError, adopt, note_in
    from mission.record.folder import RunFolder
    from mission.record.lineage import lineage

    runs = () if options.resume is None else reversed(lineage(RunFolder(options.resume)))
    note = next((note for run in runs if (note := note_in(run.path)) is not None), None)
    if note is None:
        return None
    try:
        vehicle = adopt(note, speed=speed, folder=options.folder.telemetry.resolve())
    except StillFlownError as error:
        raise FlightError(f"{options.resume}: {error}") from None
    if vehicle is not None:
        _leave_note(options, note)
    return vehicle


def _leave_note(options: FlightOptions, note: VehicleNote) -> None:
    try:
        note.write(options.folder.path)
    except OSError as error:
        raise FlightError(f"{options.folder.path}: {error.strerror}") from error


def _spawn(options: FlightOptions, speed: float) -> VehicleProcess:
    from devices.vehicle.settings import LinkSettings, ProcessSettings, VehicleSettings
    from devices.vehicle.spawn import SpawnError, spawn
    from devices.world.settings import WorldSettings

    mission = options.mission
    settings = mission.world or WorldSettings()
    try:
        vehicle = spawn(
            ProcessSettings(
                vehicle=VehicleSettings.of_world(settings),
                seed=settings.seed,
                speed=speed,
                links=(LinkSettings(),),
                folder=options.folder.telemetry.resolve(),
                watch_parent=True,
                world={
                    "turbine": mission.turbine.model_dump(),
                    "site": mission.site.model_dump(),
                    "settings": settings.model_dump(),
                },
            )
        )
    except SpawnError as error:
        raise FlightError(str(error)) from error
    _leave_note(options, vehicle.note)
    return vehicle
