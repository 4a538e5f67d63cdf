"""Whether a calibration's data carry its focal lengths, or leave focal length and distance to trade places."""

from __future__ import annotations

import numpy as np

from vision.calibration_fit import CameraFit, Nominal
from vision.calibration_pairs import fits_badly
from vision.camera import StereoPair

WANTED_VIEWS = 10
WANTED_TILT = np.deg2rad(15)  # spread of the board's tilt among the views
WANTED_COVERAGE = 0.5
LARGEST_FOCAL_SIGMA = 0.01  # of the focal length
NOMINAL_TOLERANCE = 0.03  # by which a lens may differ from its data sheet


def doubts_of(left: CameraFit, right: CameraFit, nominal: Nominal) -> list[str]:
    """Why the free fits may not be trusted, in plain words."""
    doubts = []
    for name, fit in (("left", left), ("right", right)):
        focal = fit.camera.fx
        share = fit.focal_sigma_px / focal
        if not share < LARGEST_FOCAL_SIGMA:
            doubts.append(
                f"the {name} focal length is known to ±{share:.0%} only ({focal:.0f} ± {fit.focal_sigma_px:.0f} px)"
            )
        if nominal.focal_px is not None and abs(focal / nominal.focal_px - 1) > NOMINAL_TOLERANCE:
            doubts.append(f"the {name} focal length comes out as {focal:.0f} px, nominal {nominal.focal_px:.0f} px")
    if abs(np.log(left.camera.fx / right.camera.fx)) > NOMINAL_TOLERANCE:
        doubts.append(f"the two focal lengths differ: {left.camera.fx:.0f} and {right.camera.fx:.0f} px")
    return doubts


def conditions_of(left: CameraFit, right: CameraFit, *, doubted: bool) -> list[str]:
    """What the views lack, in plain words; doubted: the focal lengths are, so that a lack of tilt is named too."""
    lacks = []
    tilt = float(max(left.tilt.max(), right.tilt.max()))
    if doubted and tilt < WANTED_TILT:
        lacks.append(f"the board was tilted by {np.degrees(tilt):.1f}° at most: tilt it by 15 to 45° about both axes")
    views = min(len(left.tilt), len(right.tilt))
    if views < WANTED_VIEWS:
        lacks.append(f"there are only {views} views: take {WANTED_VIEWS} to 30")
    share = min(float((fit.coverage > 0).mean()) for fit in (left, right))
    if share < WANTED_COVERAGE:
        lacks.append(f"the corners cover {share:.0%} of the image only: bring the board into every corner of it")
    return lacks


def doubts_of_pair(
    stereo: StereoPair, rms: float, alone: float, given_m: float | None, square_m: float, nominal: Nominal
) -> list[str]:
    """Why the motion between the cameras may not be trusted, in plain words."""
    doubts = []
    if fits_badly(rms, alone):
        doubts.append(f"the two cameras do not fit together: {rms:.2f} px, where each alone has {alone:.2f} px")
    if stereo.translation[1] > 0.5 * stereo.baseline_m:
        doubts.append("the right camera comes out to the left of the left one: are the pictures swapped?")
    if given_m is None:
        doubts.append(
            "the square's size is not given; the nominal baseline, itself not measured, "
            f"makes it {square_m * 1e3:.1f} mm"
        )
    elif nominal.baseline_m is not None and abs(stereo.baseline_m / nominal.baseline_m - 1) > 0.05:
        doubts.append(
            f"the baseline comes out as {stereo.baseline_m * 1000:.1f} mm, nominal {nominal.baseline_m * 1000:.1f} mm"
        )
    return doubts
