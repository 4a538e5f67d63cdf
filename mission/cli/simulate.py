"""The simulated vehicle alone, speaking MAVLink like PX4."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from devices.vehicle.settings import ProcessSettings, Surroundings
    from devices.world.settings import WorldSettings

COMPANION_PORT = 14540
COMPANION_LISTENS = 14580
STATION_PORT = 14550
STATION_LISTENS = 18570


def simulate(
    mission: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Put the vehicle into this mission's world: its turbine and wind."),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Override a value of that mission; repeat it."),
    ] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=50.0, help="Simulated seconds per wall second.")] = 1.0,
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="Where the companion computer's program listens.")
    ] = COMPANION_PORT,
    station_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Where a ground station listens; 0 for no such link.")
    ] = STATION_PORT,
    listen: Annotated[
        int, typer.Option(min=0, max=65535, help="Where the vehicle listens to the companion computer; 0: any port.")
    ] = COMPANION_LISTENS,
    wind: Annotated[float | None, typer.Option(min=0, max=40, metavar="M/S", help="Steady wind.")] = None,
    gust: Annotated[float | None, typer.Option(min=0, max=60, metavar="M/S", help="Speed that gusts reach.")] = None,
    wind_from: Annotated[
        float | None, typer.Option(min=-360, max=360, metavar="DEG", help="Where the wind comes from.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Another wind, noise and drift.")] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="NAME=VALUE", help="Another value of an autopilot parameter; repeat it."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write truth.csv and vehicle_events.jsonl there.")
    ] = None,
) -> None:
    """Run the simulated vehicle until Ctrl-C, for any MAVLink client.

    It sends to UDP 14540 (companion computer) and 14550 (ground station), as PX4 SITL does, and prints its ports as one
    line of JSON.

    \b
    Examples:
      mission simulate --speed 4
      mission simulate --wind 8 --gust 12 --wind-from 200
      mission simulate --mission missions/v80_blade.yaml
      mission simulate --param COM_OBL_RC_ACT=0 --param COM_OF_LOSS_T=5     as PX4 SITL starts
      mission run missions/v80_blade.yaml --system udpin://0.0.0.0:14540    in another terminal, with the same --speed
      mavproxy.py --master=udpin:127.0.0.1:14550                            or fly it by hand
    """
    from devices.vehicle.settings import LinkSettings, ProcessSettings, VehicleSettings

    if changes and mission is None:
        raise CommandError("simulate: --set changes a mission's world: name it with --mission FILE")
    changed = _parameters(parameters or [])
    world, surroundings = _world(mission, changes or [])
    breeze = world.wind
    breeze = breeze.model_copy(
        update={
            "mean_m_s": breeze.mean_m_s if wind is None else wind,
            "gust_m_s": (breeze.gust_m_s if wind is None else wind) if gust is None else gust,
            "from_deg": breeze.from_deg if wind_from is None else wind_from,
        }
    )
    links = [LinkSettings(local_port=listen, remote_port=port)]
    if station_port:
        links.append(LinkSettings(role="gcs", local_port=STATION_LISTENS if listen else 0, remote_port=station_port))
    _serve(
        ProcessSettings(
            vehicle=VehicleSettings.of_world(world.model_copy(update={"wind": breeze}), parameters=changed),
            seed=world.seed if seed is None else seed,
            speed=speed,
            links=tuple(links),
            folder=record,
            world=surroundings,
        )
    )


def _world(mission: Path | None, changes: list[str]) -> tuple[WorldSettings, Surroundings | None]:
    """The world of a mission with what stands in it, or a plain one under an empty sky."""
    from devices.vehicle.settings import Surroundings
    from devices.world.settings import WorldSettings

    if mission is None:
        return WorldSettings(), None
    from mission.language.document import load

    document = load(mission, changes)
    world = document.world or WorldSettings()
    around = Surroundings(turbine=document.turbine.model_dump(), site=document.site.model_dump(), settings=world)
    return world, around


def _parameters(changes: list[str]) -> dict[str, float]:
    """Values by name; one line where a name is not the simulated autopilot's or a value is no number."""
    from math import isfinite

    from devices.vehicle.parameters import DEFAULTS

    values: dict[str, float] = {}
    for change in changes:
        name, _, text = change.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise CommandError(f"simulate: --param {change}: write NAME=VALUE with a number")
        if name not in DEFAULTS:
            raise CommandError(f"simulate: --param {change}: the simulated autopilot has no parameter {name!r}")
        values[name] = value
    return values


def _serve(settings: ProcessSettings) -> None:
    from devices.vehicle.process import serve
    from devices.vehicle.udp_link import PortInUseError

    try:
        serve(settings)
    except PortInUseError as error:
        raise CommandError(f"simulate: {error}") from None
