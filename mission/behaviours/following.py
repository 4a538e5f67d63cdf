"""One control tick beside the blade, shared by the behaviours that steer by the tracked edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from flight.guidance.follow import LONGEST_TICK_S, FollowCommand, FollowSettings, FollowState, View, follow

if TYPE_CHECKING:
    from mission.executive.services import Services
    from vision.estimate import BladeEstimate, SideEstimate

ROOM = 0.4  # share of the half image kept free beyond the edge (5.16): enough background to find it by
FULL_SPEED_AGE_S = 0.8  # vision younger than this: full speed
STOP_AGE_S = 2.0  # older: creep no further on prediction alone


class Following:
    """Holds one side of the blade at the standoff and moves along it; the behaviours decide when that ends."""

    def __init__(
        self,
        services: Services,
        *,
        side: Literal["leading", "trailing"],
        toward: Literal["tip", "root"],
        standoff_m: float,
        speed_m_s: float = 0.0,
    ) -> None:
        lens = services.rig.geometry.stereo.left
        self._services = services
        self._state = FollowState()
        self._last_s: float | None = None
        self.settings = FollowSettings(
            frame=services.perception.frame,
            view=View(lens.width, lens.height, lens.fx),
            mount=np.array(services.mission.rig.mount_m),
            heading=services.turbine.heading,
            side=side,
            toward=toward,
            standoff_m=standoff_m,
            speed_m_s=speed_m_s,
            k=ROOM,
        )
        services.perception.watch_blade(True)

    def tick(self, now: float) -> tuple[BladeEstimate, FollowCommand] | None:
        """Steer once by the estimate for now; None, and nothing changes, as long as the blade was never seen.

        The older the last image, the slower: bridging a drop-out must not carry the vehicle far along.
        """
        estimate = self._services.perception.estimate()
        if estimate is None:
            return None
        fresh = (STOP_AGE_S - estimate.age_s) / (STOP_AGE_S - FULL_SPEED_AGE_S)
        settings = replace(self.settings, speed_m_s=self.settings.speed_m_s * min(1.0, max(0.0, fresh)))
        command = follow(estimate, self._services.autopilot.telemetry.pose, settings, self._state)
        elapsed, self._last_s = min(now - (self._last_s if self._last_s is not None else now), LONGEST_TICK_S), now
        self._state = command.state
        setpoints = self._services.setpoints
        if setpoints.keep_out is not None:
            setpoints.keep_out = setpoints.keep_out.with_blade_surface(estimate, elapsed)
        setpoints.target = command.setpoint
        self._services.autopilot.point_gimbal(command.gimbal_yaw, command.gimbal_pitch)
        self._services.progress.station_m = estimate.station_m
        return estimate, command

    async def hold(self, good: Callable[[BladeEstimate, FollowCommand], bool], steady_s: float) -> None:
        """Steer until `good` has said so at every tick for so long."""
        since: float | None = None
        async for now in self._services.ticks():
            steered = self.tick(now)
            if steered is None:
                continue
            if not good(*steered):
                since = None
                continue
            since = now if since is None else since
            if now - since >= steady_s:
                return
        raise AssertionError("ticks never end")

    def side(self, estimate: BladeEstimate) -> SideEstimate | None:
        """The followed edge in an estimate."""
        return estimate.leading if self.settings.side == "leading" else estimate.trailing
