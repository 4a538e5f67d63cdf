"""How much room there is between an edge and the border of the image (5.15, 5.16). Pixels of the full image."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, sin


@dataclass(frozen=True)
class View:
    """The left camera's image: width and height in pixels, focal length in pixels."""

    width_px: float
    height_px: float
    focal_px: float

    def reach(self, theta: float) -> float:
        """Pixels from the image centre to the tangent, with normal direction theta, of the ellipse inscribed in the
        image."""
        return 0.5 * hypot(self.width_px * cos(theta), self.height_px * sin(theta))


def free_room(view: View, theta: float, rho: float) -> float:
    """ρ_f (5.15): pixels between an edge (theta, rho) and the border beyond it, negative where it has left the
    ellipse."""
    return view.reach(theta) - rho


def least_room(view: View, theta: float, k: float) -> float:
    """ρ_min (5.16): the room to keep, the share k (0 to 1) of what there is."""
    if not 0 <= k <= 1:
        raise ValueError(f"the share of room k is {k}: it must lie between 0 and 1")
    return k * view.reach(theta)


def room_beyond_centre(view: View, theta: float, rho: float) -> float:
    """ρ_f (5.19): the room where the edge lies on the wrong side of the centre, with the whole blade beyond the
    centre."""
    return view.reach(theta) + rho
