"""The wire to the vehicle: MAVSDK's connection, single messages and commands in both directions, and its clean end."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from flight.autopilot import AutopilotError
from flight.udp_port import check_address

if TYPE_CHECKING:
    from mavsdk.asyncio import Mavsdk
    from mavsdk.plugins.mavlink_direct import MavlinkDirect

logger = logging.getLogger(__name__)

AUTOPILOT = 1
_ANSWER_S = 5.0  # wall seconds; MAVSDK itself gives up on a command after about two

OnMessage = Callable[[str, int, Mapping[str, Any]], None]


class MavlinkChannel:
    """One vehicle. on_message(name, component, fields) is called on the library's thread."""

    def __init__(self, on_message: OnMessage) -> None:
        self._on_message = on_message
        self._mavsdk: Mavsdk | None = None
        self._direct: MavlinkDirect | None = None
        self._system: Any = None
        self._blocking: set[asyncio.Future[Any]] = set()
        self.system_id = 1

    @property
    def system(self) -> Any:
        """MAVSDK's System, for its plugins. Raises AutopilotError where there is none."""
        if self._system is None:
            raise AutopilotError("the link to the vehicle is closed")
        return self._system

    async def open(self, address: str, timeout_s: float, messages: Iterable[str], *, ground_station: bool) -> None:
        """Find a vehicle and subscribe to messages by their names; timeout_s is wall time.

        We are a companion computer (1/195), not a ground station: PX4 would count a ground station's heartbeat, which
        MAVSDK sends from its own thread, as proof that the data link to the operator is alive. The price is that PX4
        sends no STATUSTEXT; `ground_station` buys it where no other ground station is, as in simulation.

        Raises:
            AutopilotError: bad address, port in use, or nobody there.
        """
        check_address(address)
        from mavsdk import logging as mavsdk_logging
        from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
        from mavsdk.plugins.mavlink_direct import MavlinkDirect

        mavsdk_logging.log_subscribe(_swallow)
        kind = ComponentType.GROUND_STATION if ground_station else ComponentType.COMPANION_COMPUTER
        self._mavsdk = Mavsdk(Configuration.create_with_component_type(kind))
        try:
            await self._mavsdk.add_any_connection(address)
        except Exception as error:
            raise AutopilotError(f"cannot open {address}: {error}") from None
        system = await self._mavsdk.first_autopilot(timeout_s)
        if system is None:
            raise AutopilotError(
                f"no autopilot on {address} within {timeout_s:g} s: is it powered, and does it send to this port?"
            )
        self._system = system
        self.system_id = await system.get_system_id()
        # The asynchronous wrapper would cost a thread switch per setpoint; the call itself takes 0.3 ms.
        self._direct = MavlinkDirect(system._system)
        for name in messages:
            self._direct.subscribe_message(name, self._receive)

    async def close(self) -> None:
        """End everything; idempotent."""
        mavsdk, self._mavsdk = self._mavsdk, None
        direct, self._direct = self._direct, None
        self._system = None
        if self._blocking:
            # Destroying the library under a call that still waits in a thread is not safe; each gives up by itself.
            await asyncio.wait(self._blocking, timeout=1.5)
        if direct is not None:
            direct.destroy()
        if mavsdk is not None:
            mavsdk.destroy()

    def send(self, name: str, fields: Mapping[str, Any]) -> None:
        """Send one message once, now; it takes about 0.3 ms. A None among the fields is sent as NaN."""
        from mavsdk.plugins.mavlink_direct import MavlinkDirectError

        try:
            self._require_direct().send_message(self._message(name, fields))
        except MavlinkDirectError as error:
            raise AutopilotError(f"{name} could not be sent: {error.result.name.lower().replace('_', ' ')}") from None

    async def command(self, command: int, what: str, *parameters: float) -> int:
        """MAV_RESULT of a command. Answers come as a callback, so that no thread waits for them.

        Raises:
            AutopilotError: no answer; `what` names the command in words.
        """
        from mavsdk.plugins.mavlink_direct import MavlinkDirectResult

        loop, direct = asyncio.get_running_loop(), self._require_direct()
        answer: asyncio.Future[int | None] = loop.create_future()

        def resolve(result: int | None) -> None:
            if not answer.done():
                answer.set_result(result)

        def on_answer(outcome: Any, ack: Any, _: Any) -> None:
            found = json.loads(ack.fields_json).get("result") if outcome is MavlinkDirectResult.SUCCESS else None
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(resolve, found)

        fields: dict[str, Any] = {"target_system": self.system_id, "target_component": AUTOPILOT}
        fields |= {"command": command, "confirmation": 0}
        fields |= {f"param{i + 1}": float(parameters[i]) if i < len(parameters) else 0.0 for i in range(7)}
        direct.send_command_async(self._message("COMMAND_LONG", fields), on_answer)
        result = None
        with contextlib.suppress(TimeoutError):
            result = await asyncio.wait_for(answer, _ANSWER_S)
        if result is None:
            raise AutopilotError(f"{what}: the autopilot does not answer")
        return result

    async def blocking(self, call: Awaitable[Any]) -> Any:
        """Await a call of a plugin that blocks a thread, and remember it for `close` even when the caller is
        cancelled."""
        future = asyncio.ensure_future(call)
        self._blocking.add(future)
        future.add_done_callback(self._blocking.discard)
        future.add_done_callback(lambda done: None if done.cancelled() else done.exception())
        return await asyncio.shield(future)

    def _receive(self, message: Any, _: Any) -> None:
        if message.system_id == self.system_id and self._system is not None:
            try:
                self._on_message(message.message_name, message.component_id, json.loads(message.fields_json))
            except (KeyError, TypeError, ValueError) as error:
                logger.warning("unreadable %s: %s", message.message_name, error)

    def _message(self, name: str, fields: Mapping[str, Any]) -> Any:
        from mavsdk.plugins.mavlink_direct import MavlinkMessage

        return MavlinkMessage(name, 0, 0, self.system_id, AUTOPILOT, json.dumps(fields))

    def _require_direct(self) -> MavlinkDirect:
        if self._direct is None:
            raise AutopilotError("the link to the vehicle is closed")
        return self._direct


def _swallow(level: Any, message: str, file: str | None, line: int) -> bool:
    """MAVSDK's own messages go to the run's log, not to the operator's terminal."""
    logger.debug("mavsdk: %s", message)
    return True
