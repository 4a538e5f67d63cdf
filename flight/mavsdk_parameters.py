"""The autopilot's parameters, read and written over MAVSDK: whole numbers and fractions alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flight.autopilot import AutopilotError
from flight.mavlink_channel import MavlinkChannel


async def read_parameters(channel: MavlinkChannel, names: Sequence[str]) -> Mapping[str, float]:
    """Values of the autopilot's parameters; those that it does not have are left out.

    Raises:
        AutopilotError: the link is lost.
    """
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.plugins.param import ParamError, ParamResult

    plugin = ParamAsync(channel.system)
    values: dict[str, float] = {}
    for name in names:
        for get in (plugin.get_param_int, plugin.get_param_float):
            try:
                values[name] = float(await channel.blocking(get(name)))
                break
            except ParamError as error:
                if error.result in (ParamResult.NO_SYSTEM, ParamResult.CONNECTION_ERROR):
                    raise AutopilotError(f"parameter {name}: the link to the autopilot is lost") from None
                if error.result is not ParamResult.WRONG_TYPE:
                    break
    return values


async def write_parameter(channel: MavlinkChannel, name: str, value: float) -> None:
    """Change a parameter, of whichever type it is, and read it back.

    Raises:
        AutopilotError: it cannot be set, or the autopilot does not hold what was set.
    """
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.plugins.param import ParamError, ParamResult

    plugin = ParamAsync(channel.system)
    try:
        try:
            await channel.blocking(plugin.get_param_int(name))
            await channel.blocking(plugin.set_param_int(name, round(value)))
        except ParamError as error:
            if error.result is not ParamResult.WRONG_TYPE:
                raise
            await channel.blocking(plugin.set_param_float(name, float(value)))
    except ParamError as error:
        answer = error.result.name.lower().replace("_", " ")
        raise AutopilotError(f"parameter {name} could not be set to {value:g}: {answer}") from None
    held = (await read_parameters(channel, [name])).get(name)
    if held is None or abs(held - value) > 1e-4 * max(1.0, abs(value)):
        raise AutopilotError(f"parameter {name} was set to {value:g} and is {held}: the autopilot refuses it")
