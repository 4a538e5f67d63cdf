"""The eye: four images in, one observation of the blade out, or the reasons why there is none."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera, RigGeometry
from vision.candidates import Candidate
from vision.capture import Image, StereoFrames
from vision.chord import chord, heading
from vision.dots import Spots, find_spots
from vision.edges import edge_of, find_edges
from vision.evidence import Blade, OtherEye, texture_between
from vision.explained import absent_dots, dots_behind, explained_dots
from vision.grid import Matches, match_eyes, match_laser, nearest_surface, reachable
from vision.lines import smoothed
from vision.mosaic import demosaiced
from vision.observation import BladeObservation, Dots
from vision.peaks import Reach
from vision.quality import brightness, exposure, ill_lit, sharpness
from vision.reduction import half_green_and_tones, reduce_image, reduction_factor, to_full
from vision.rig_doubt import rig_doubt
from vision.single import observe_photograph
from vision.spot_paint import without_spots
from vision.stopwatch import Now, Stopwatch
from vision.surface import Surface, fit_surface
from vision.tip import tip_of
from vision.workspace import lent

Array = NDArray[np.float64]

LEAST_DOTS = 4
LEAST_OTHER = 6  # dots off the fitted surface: fewer are mistakes, as many may be another surface
WORST_DISTANCE = 0.033  # standard deviation over distance, from which it may be a tenth off


class Eye:
    """Observes blades with one rig. Holds no state between frames and may be shared by threads.

    Dots, points and edges all belong to the instant of the laser-on images; the laser-off images, where there are any,
    only tell the dots apart. now: the clock that `elapsed_ms` of an observation is told by; without one it is empty.
    """

    def __init__(self, geometry: RigGeometry, now: Now | None = None) -> None:
        self.geometry = geometry
        self._now = now
        self.factor = reduction_factor(geometry.stereo.left.width)
        self._stereo = geometry.stereo.shrunk(self.factor)
        self._reach: tuple[Reach, Reach] | tuple[None, None] = (None, None)
        if geometry.laser is not None:
            stereo = self._stereo
            self._reach = (
                Reach.of(reachable(geometry.laser, stereo.left, np.eye(3), np.zeros(3))),
                Reach.of(reachable(geometry.laser, stereo.right, stereo.rotation, stereo.translation)),
            )

    def observe(self, frames: StereoFrames, expected: float | None = None) -> BladeObservation:
        """The blade as these frames show it. Never raises on what is in the images; a wrong size is a ValueError.

        expected: direction of the blade's axis in the left image, rad modulo π, where tracker or survey know it.
        """
        seen = self._observe(frames, expected)
        if seen.valid or frames.left is None:
            return seen
        # the laser-off images may show what moved otherwise than the blade: dots that stand out need none
        alone = self._observe(dataclasses.replace(frames, left=None, right=None), expected)
        return alone if alone.valid else seen

    def _observe(self, frames: StereoFrames, expected: float | None) -> BladeObservation:
        watch = Stopwatch(self._now)
        if frames.left_laser is None:
            return self._refused(frames, watch, "no left_laser image")
        images: dict[str, Image] = {}
        for name in ("left", "left_laser", "right", "right_laser"):
            image: Image | None = getattr(frames, name)
            if image is not None:
                stereo = self.geometry.stereo
                _check_size(name, image, stereo.right if name.startswith("right") else stereo.left)
                images[name] = reduce_image(image, self.factor, self.geometry.bayer)
        watch.lap("reduce")
        small, tones = half_green_and_tones(images["left_laser"], "tones of left")
        left = find_spots(images.get("left"), images["left_laser"], self._reach[0], small=small)
        images["left_laser"] = tones
        right = None
        if "right_laser" in images:
            small, tones = half_green_and_tones(images["right_laser"], "tones of right")
            right = find_spots(images.get("right"), images["right_laser"], self._reach[1], left, small)
            images["right_laser"] = tones
        watch.lap("dots")
        laser = self.geometry.laser
        if laser is None:
            return self._refused(frames, watch, "the rig has no laser, so dots have no index")
        rays, focal = self._stereo.left.rays(left.uv), self._stereo.left.fx
        if right is not None:
            rays_right = self._stereo.right.rays(right.uv)
            matches, ambiguous = match_eyes(
                rays, rays_right, self._stereo, laser, left.sigma_px / focal, right.sigma_px / focal
            )
        else:
            matches, ambiguous = match_laser(rays, laser, focal, left.sigma_px / focal)
        watch.lap("match")
        if ambiguous:
            return self._refused(frames, watch, "the dots can be read in two ways that contradict each other")
        blade = nearest_surface(matches, LEAST_DOTS)
        if len(blade) < LEAST_DOTS:
            return self._refused(
                frames, watch, f"{len(left)} spots in the left image, {len(blade)} of them dots on a blade"
            )
        surface = fit_surface(rays[blade.left], blade.inverse_depth, blade.sigma)
        if surface is None:
            return self._refused(frames, watch, f"{len(blade)} dots that make no surface before the camera")
        unsure = float(np.sqrt(surface.covariance[0, 0])) / surface.depth_m
        if unsure > WORST_DISTANCE:
            return self._refused(frames, watch, f"{len(blade)} dots give the distance only to {unsure:.0%}")
        if 0 < np.count_nonzero(~surface.inliers) < LEAST_OTHER:
            matches = matches.take(~np.isin(matches.left, blade.left[~surface.inliers]))
        blade = blade.take(surface.inliers)
        doubt = rig_doubt(rays[blade.left], blade, laser) if right is not None else None
        if doubt is not None:
            return self._refused(frames, watch, doubt)
        watch.lap("surface")
        return self._outlined(frames, images, left, right, rays, matches, blade, surface, watch, expected)

    def _outlined(
        self,
        frames: StereoFrames,
        images: dict[str, Image],
        left: Spots,
        right: Spots | None,
        rays: Array,
        matches: Matches,
        blade: Matches,
        surface: Surface,
        watch: Stopwatch,
        expected: float | None,
    ) -> BladeObservation:
        factor, camera, laser = self.factor, self._stereo.left, self.geometry.laser
        assert laser is not None
        tones = images["left_laser"]
        own = tones if tones.shape[2] > 1 else lent("clean", tones.shape, np.uint8)  # grey ones are the camera's image
        clean = without_spots(tones, images.get("left"), left, own)
        smooth = smoothed(clean, lent("smooth left", clean.shape, np.uint8))
        seeds = left.uv[blade.left]
        dots = seeds - camera.centre
        around = Blade(
            dots,
            absent_dots(left, right, matches, blade, surface, laser, self._stereo),
            texture_between(smooth, seeds),
            slope=surface.slope,
            focal=camera.fx,
            camera=camera,
            behind=dots_behind(left, rays, matches, blade, surface, camera.centre),
        )
        other = None
        if right is not None:
            behind = images["right_laser"]
            room = lent("smooth right", behind.shape, np.uint8)
            other = OtherEye(smoothed(behind, room), self._stereo, surface)
        found = find_edges(clean, smooth, around, other, expected)
        watch.lap("edges")
        edges, axis, reasons = found.edges, found.axis, found.reasons
        watch.lap("tip")
        points = rays[blade.left] / blade.inverse_depth[:, None]
        near = _station_near(dots, axis) if edges else None
        width = chord(edges, axis, camera, surface, near) if near is not None else None
        direction = heading(edges, axis, camera, surface, near) if near is not None else None
        if direction is None and np.isfinite(axis):
            direction = axis
        sharp = sharpness(clean, edges)
        bright = exposure(images.get("left", clean), seeds)
        dots_left = explained_dots(left, rays, matches, surface, laser, factor)
        dots_right = None
        if right is not None:
            known = matches.right >= 0
            dots_right = Dots(
                to_full(right.uv[matches.right[known]], factor), matches.row[known], matches.column[known]
            )
        watch.lap("rest")
        return BladeObservation(
            stamp_s=frames.stamp_s,
            valid=True,
            reasons=reasons,
            dots_left=dots_left,
            dots_right=dots_right,
            matches=np.column_stack([matches.row, matches.column]) if right is not None else None,
            points=points,
            sigma_m=blade.sigma / blade.inverse_depth**2,
            normal=surface.normal,
            plane_point=np.array([surface.depth_m, 0.0, 0.0]),
            plane_covariance=surface.covariance,
            distance_m=surface.depth_m,
            distance_sigma_m=float(np.sqrt(surface.covariance[0, 0])),
            nearest_m=surface.nearest_m(rays[blade.left]),
            edges=tuple(edge_of(edges[k], factor) for k in _left_first(edges, axis)),
            tip=tip_of(found.ending, factor) if found.ending is not None else None,
            heading=direction,
            heading_sigma=_heading_sigma(edges) if direction is not None else None,
            chord_m=width[0] if width else None,
            chord_sigma_m=width[1] if width else None,
            sharpness=sharp,
            exposure=bright,
            elapsed_ms=watch.elapsed_ms,
        )

    def _refused(self, frames: StereoFrames, watch: Stopwatch, *reasons: str) -> BladeObservation:
        grey = brightness(frames.left_laser) if frames.left_laser is not None else 0.0
        watch.lap("rest")
        why = (*reasons, *ill_lit(grey))
        return BladeObservation(frames.stamp_s, False, why, exposure=grey, elapsed_ms=watch.elapsed_ms)


def observe_single(image: Image, geometry: RigGeometry | None = None, now: Now | None = None) -> BladeObservation:
    """Dots, edges and tip of one laser-on photograph (h, w) or (h, w, 3), in its own pixels. There is no distance in
    it: the rig's geometry is accepted so that a caller need not ask, and checked against the image's size. now: as for
    the Eye."""
    if geometry is not None:
        _check_size("the", image, geometry.stereo.left)
        if geometry.bayer is not None and image.ndim == 2:
            image = demosaiced(image, geometry.bayer)
    return observe_photograph(image, now=now)


def _check_size(name: str, image: Image, camera: Camera) -> None:
    (height, width), there = image.shape[:2], f"{camera.width} × {camera.height}"
    if (height, width) != (camera.height, camera.width):
        raise ValueError(f"{name} image is {width} × {height} pixels, the rig's camera {there}")


def _station_near(dots: Array, axis: float) -> Array:
    """The point nearest to the image centre among stations along the axis that carry dots."""
    along = np.array([np.cos(axis), np.sin(axis)])
    reach = dots @ along
    return along * float(np.clip(0.0, reach.min(), reach.max()))


def _heading_sigma(edges: tuple[Candidate, ...]) -> float:
    if not edges:
        return float(np.deg2rad(3.0))
    spread = float(np.sqrt(sum(e.profile.slope_sigma[e.index] ** 2 for e in edges))) / len(edges)
    return float(np.hypot(spread, np.deg2rad(0.2 if len(edges) == 2 else 1.5)))


def _left_first(edges: tuple[Candidate, ...], axis: float) -> list[int]:
    if not edges:
        return []
    left = np.array([np.sin(axis), -np.cos(axis)])
    return sorted(range(len(edges)), key=lambda k: -float(edges[k].outward @ left))
