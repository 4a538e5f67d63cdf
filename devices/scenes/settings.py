"""What a close-up scene is made of, and how scenes are drawn at random over the range the eye has to master."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

View = Literal["two_edges", "one_edge", "wrong_side", "no_edge", "tip"]
TipShape = Literal["round", "square", "spike"]
Behind = Literal["sky", "ground", "horizon", "clutter", "tower", "blade"]
VIEWS: tuple[View, ...] = ("two_edges", "one_edge", "wrong_side", "tip")


@dataclass(frozen=True)
class SceneSettings:
    """One scene. Angles in radians, lengths in metres, brightness 0 to 255; pixels (`_px`) are of a 612 pixels wide
    image.

    angle: direction of the blade's axis in the image, clockwise from +y_im; with a tip, the tip lies that way.
    centre_m: offset of the blade's middle line from the optical axis across the blade. taper: change of each half
    width per metre of axis.
    tip_m: from the optical axis along the blade to its end, None without. curvature: 1/m, of the surface across the
    axis. motion_px (2,): shift of the laser-off images against the laser-on images, of the *full* image.
    """

    seed: int = 0
    view: View = "two_edges"
    scale: int = 1  # 1: 612 × 512 with f = 616 px, 4: 2448 × 2048 with f = 2464 px
    colour: bool = True
    angle: float = 0.0
    distance_m: float = 3.0
    tilt: tuple[float, float] = (0.0, 0.0)  # slopes of the surface's normal, right and down
    chord_m: float = 1.0
    centre_m: float = 0.0
    taper: tuple[float, float] = (0.0, 0.0)
    curvature: float = 0.0
    tip_m: float | None = None
    tip_shape: TipShape = "round"
    baseline_m: float = 0.20
    laser_position_m: tuple[float, float, float] = (0.0, 0.10, -0.06)
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    brightness: float = 150.0
    shade: float = 0.2  # relative change of brightness over the image
    dirt: float = 0.2
    glare: float = 0.0
    background: Behind = "horizon"
    dot_level: float = 110.0
    dot_sigma_px: float = 1.4
    dot_streak: float = 1.0
    noise: float = 2.0
    blur_px: float = 0.6
    motion_blur_px: float = 0.0
    motion_px: tuple[float, float] = (0.0, 0.0)


def random_settings(
    seed: int,
    *,
    view: View | None = None,
    scale: int = 1,
    colour: bool | None = None,
    angle: float | None = None,
    distance_m: float | None = None,
    baseline_m: float | None = None,
    brightness: float | None = None,
    motion: bool = False,
    background: Behind | None = None,
) -> SceneSettings:
    """Settings drawn reproducibly from `seed`; what is given is held."""
    rng = np.random.default_rng([seed, 7])
    u = rng.uniform
    view = view or VIEWS[int(rng.integers(len(VIEWS)))]
    angle_drawn, distance_drawn = u(0, 2 * np.pi), u(1.5, 6.0)
    angle = angle_drawn if angle is None else angle
    distance = distance_drawn if distance_m is None else distance_m
    metres = distance / 616.0  # of one pixel of a 612 pixels wide image
    widest = min(3.5, 400 * metres)
    chord = u(0.5, max(widest, 0.5001))
    tip = None
    side = rng.choice([-1.0, 1.0])
    centre = u(-0.15, 0.15) * min(chord, 250 * metres)
    if view == "one_edge":
        chord = max(u(0.9, 3.5), 480 * metres)
        centre = side * (chord / 2 - u(20, 170) * metres)
    elif view == "wrong_side":
        chord = max(u(0.7, 3.5), 350 * metres)
        centre = side * (chord / 2 + u(5, 70) * metres)
    elif view == "no_edge":
        chord = max(3.5, 1100 * metres)
    elif view == "tip":
        chord = u(0.4, max(min(1.6, 320 * metres), 0.4001))
        centre = u(-0.2, 0.2) * chord
        tip = u(-20, 150) * metres
    tilt_size, tilt_way = np.tan(np.deg2rad(25)) * np.sqrt(u(0, 1)), u(0, 2 * np.pi)
    laser_choice = int(rng.integers(3))
    drawn_baseline = u(0.05, 0.30)
    baseline = drawn_baseline if baseline_m is None else baseline_m
    laser = [(0.0, 0.10, -0.06), (0.0, baseline / 2, -0.05), (0.0, -0.06, 0.02)][laser_choice]
    half = max(chord / 2, 0.3)
    motion_way = u(0, 2 * np.pi)
    motion_size = u(5, 30) if motion else 0.0
    backgrounds: tuple[Behind, ...] = ("sky", "ground", "horizon", "clutter", "tower", "blade")
    drawn_background = backgrounds[int(rng.integers(len(backgrounds)))]
    drawn_brightness = u(25, 235)
    drawn_colour = bool(rng.uniform() < 0.7)
    return SceneSettings(
        seed=seed,
        view=view,
        scale=scale,
        colour=drawn_colour if colour is None else colour,
        angle=float(angle),
        distance_m=float(distance),
        tilt=(float(tilt_size * np.cos(tilt_way)), float(tilt_size * np.sin(tilt_way))),
        chord_m=float(chord),
        centre_m=float(centre),
        taper=(float(u(-0.03, 0.03)), float(u(-0.03, 0.03))),
        curvature=float(rng.choice([0.0, u(0, 0.06) / half**2])),
        tip_m=None if tip is None else float(tip),
        tip_shape=("round", "square", "spike")[int(rng.integers(3))],
        baseline_m=float(baseline),
        laser_position_m=laser,
        distortion=(float(u(-0.08, 0.04)), float(u(-0.03, 0.03)), 0.0, 0.0) if rng.uniform() < 0.5 else (0.0,) * 4,
        brightness=float(drawn_brightness if brightness is None else brightness),
        shade=float(u(0, 0.5)),
        dirt=float(u(0, 0.35)),
        glare=float(rng.choice([0.0, u(0, 0.3)])),
        background=drawn_background if background is None else background,
        dot_level=float(u(70, 170)),
        dot_sigma_px=float(u(1.0, 2.1)),
        dot_streak=float(rng.choice([1.0, 1.0, u(1, 2)])),
        noise=float(u(0.8, 4)),
        blur_px=float(u(0.4, 1.1)),
        motion_blur_px=float(rng.choice([0.0, 0.0, u(0, 5)])),
        motion_px=(float(motion_size * np.cos(motion_way)), float(motion_size * np.sin(motion_way))),
    )
