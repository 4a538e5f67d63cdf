"""The land detector: whether the vehicle stands on the ground, since when, and whether it has flown before."""

from __future__ import annotations

_LANDED_AFTER_S = 2.0  # of contact without the wish to climb


class LandDetector:
    """On the ground from the beginning. armed_s, landed_s: when that last happened."""

    def __init__(self) -> None:
        self.landed = True
        self.taking_off = False
        self.armed_s = self.landed_s = 0.0
        self._contact_s = 0.0

    @property
    def flown(self) -> bool:
        """Whether it has left the ground since it was armed."""
        return self.landed_s != self.armed_s

    def arm(self, time_s: float) -> None:
        """The motors start, on the ground."""
        self.landed = True
        self.armed_s = self.landed_s = time_s

    def leave(self) -> None:
        """It takes off."""
        self.landed, self.taking_off = False, True
        self._contact_s = 0.0

    def touches_down(self, contact: bool, time_s: float, seconds: float) -> bool:
        """Whether it has landed just now: it touches the ground without wanting up, and has done so for long enough."""
        self._contact_s = self._contact_s + seconds if contact else 0.0
        if self._contact_s < _LANDED_AFTER_S:
            return False
        self.landed, self.taking_off = True, False
        self.landed_s = time_s
        return True
