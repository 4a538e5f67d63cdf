"""Direction of travel in the image from the blade's edges (5.2, 5.14, 5.17 to 5.22). Radians clockwise from +y_im.

An edge is given by its *outward* direction theta, from the blade to the background, and its distance rho ≥ 0 from the
image centre. `turn` is +1 where travel is a quarter turn clockwise (in the image, y right and z down) from the outward
direction, and -1 where it is anticlockwise: `turn_of` tells from the direction that the blade is known to run in.
"""

from __future__ import annotations

from math import cos, pi, sin

from flight.guidance.angles import circular_mean, difference, wrap
from flight.guidance.rooms import View, free_room, least_room, room_beyond_centre


def velocity_along(speed: float, omega: float) -> tuple[float, float]:
    """(5.2): velocity right and down along a blade at angle omega."""
    return speed * cos(omega), speed * sin(omega)


def turn_of(theta: float, along: float) -> int:
    """On which side of an outward normal theta the direction `along` lies: +1 clockwise, -1 anticlockwise."""
    return 1 if difference(along, theta) >= 0 else -1


def heading_on_both(directions: tuple[float, float], reverse: bool = False) -> float:
    """(5.14): the mean of the two edges' directions of travel to the tip; reverse: to the root.

    The mean is circular, and `directions` are directions rather than axes, so that no blade angle is special.
    """
    return wrap(circular_mean(directions) + (pi if reverse else 0.0))


def weight_on_one(rho_min: float, rho_free: float) -> float:
    """W (5.17, 5.18): 1 where the room is as wanted, toward 2 (away from the edge) with plenty, toward 0 (to it) with
    none."""
    if rho_free <= 0:
        return 0.0
    if rho_min <= rho_free:
        return 2.0 - rho_min / rho_free
    return rho_free / rho_min


def heading_on_one(view: View, theta: float, rho: float, k: float, turn: int) -> float:
    """(5.17, 5.18): along one edge while its room to the border tends to ρ_min.

    A camera that moves toward the edge brings it nearer to the centre and so makes room: with too little room the
    heading leans outward (W < 1), with plenty inward (W > 1), and W = 1 travels parallel to it.
    """
    room, least = free_room(view, theta, rho), least_room(view, theta, k)
    return wrap(theta + turn * pi / 2 * weight_on_one(least, room))


def heading_on_wrong_side(view: View, theta: float, rho: float, k: float, turn: int) -> float:
    """(5.19 to 5.22): the centre looks past the edge into the background; travel back over it onto the blade.

    theta here is the line's own direction, from the centre to the edge and so onto the blade: W = ρ_min/ρ_f with the
    room measured on the far side, and ω = θ ∓ (π/2) W. `turn` is that of the *outward* direction theta + π, hence the
    minus.
    """
    weight = least_room(view, theta, k) / room_beyond_centre(view, theta, rho)
    return wrap(theta - turn * pi / 2 * weight)
