"""The messages that an autopilot is asked for, and how often it shall send each."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from flight import px4_modes
from flight.autopilot import AutopilotError
from flight.mavlink_channel import MavlinkChannel

logger = logging.getLogger(__name__)

_INTERVALS_S: Mapping[int, float] = {
    30: 1 / 30,  # ATTITUDE: 100 Hz would be three poses for each position
    32: 1 / 30,  # LOCAL_POSITION_NED
    33: 0.5,  # GLOBAL_POSITION_INT: only shown
    132: 0.1,  # DISTANCE_SENSOR
    147: 1.0,  # BATTERY_STATUS
    230: 0.5,  # ESTIMATOR_STATUS
    231: 0.5,  # WIND_COV: not sent without being asked for
    436: 0.1,  # CURRENT_MODE: a mode that a pilot takes shall be seen at once, not with the next heartbeat
}
_SET_MESSAGE_INTERVAL = 511


async def request_streams(channel: MavlinkChannel) -> None:
    """Ask for the streams at our rates; one that the autopilot does not have is only missed.

    Raises:
        AutopilotError: nobody answers.
    """
    for message, interval in _INTERVALS_S.items():
        result = await channel.command(_SET_MESSAGE_INTERVAL, "set a message interval", message, interval * 1e6)
        if result != 0:
            logger.info("message %d at %.3g s: %s", message, interval, px4_modes.RESULTS.get(result, result))


async def keep_streams(channel: MavlinkChannel, heard: Callable[[], bool]) -> None:
    """Ask for the streams again when the vehicle was away, since it may have started anew. Until cancelled."""
    connected = True
    while True:
        await asyncio.sleep(0.25)
        was, connected = connected, heard()
        if connected and not was:
            try:
                await request_streams(channel)
            except AutopilotError:
                connected = False
