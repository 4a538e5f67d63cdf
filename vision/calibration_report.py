"""What a calibration found and how far it may be trusted, as text and as a picture of where the corners were."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.calibration import StereoFit
from vision.calibration_fit import CELLS, CameraFit
from vision.calibration_laser import LaserFit

MARGIN, SCALE_PX = 24, 480


def stereo_text(fit: StereoFit, unused: Sequence[str] = ()) -> str:
    """The report, a line per fact, and one per view; warnings come last and are marked. unused: pictures that could not
    be views at all, and why."""
    angles = np.degrees(_angles(fit.stereo.rotation))
    lines = [
        f"fit            {fit.chosen}" + (" at the nominal focal length" if fit.chosen == "held" else ""),
        f"baseline       {fit.stereo.baseline_m * 1000:.2f} mm"
        + (" (nominal: it gave the scale)" if fit.scale_from == "baseline" else ""),
        f"right camera   at {_row(-fit.stereo.rotation.T @ fit.stereo.translation * 1000, 2)} mm forward, right, down",
        f"               turned by {_row(angles, 3)} degrees roll, pitch, yaw",
        f"stereo error   {fit.rms_px:.3f} px reprojection, {fit.epipolar_px:.3f} px epipolar",
    ]
    for name, camera, free in (("left", fit.left, fit.free[0]), ("right", fit.right, fit.free[1])):
        lines += ["", *_camera_lines(name, camera)]
        if camera.held:
            found, sigma = free.camera.fx, free.focal_sigma_px
            lines.append(f"  fitted freely  focal length {found:.1f} ± {sigma:.1f} px, {free.rms_px:.3f} px")
    wide = max(len("view"), *(len(view.name) for view in fit.views))
    lines += ["", f"{'view':{wide}}    left   right  together   tilt   (px, degrees)"]
    for view in fit.views:
        errors = f"{_number(view.left_px, 6)}  {_number(view.right_px, 6)}    {_number(view.together_px, 6)}"
        tilt = f"{_number(float(np.degrees(view.tilt)), 5, 1)}"
        lines.append(f"{view.name:{wide}}  {errors}  {tilt}   {view.left_out}".rstrip())
    lines += [f"left out: {what}" for what in unused]
    if fit.warnings:
        lines += ["", *[f"warning: {warning}" for warning in fit.warnings]]
    return "\n".join(lines) + "\n"


def laser_text(fit: LaserFit) -> str:
    """The laser's report and the section for a rig file."""
    fan, angles = np.degrees(fit.laser.fan), np.degrees(fit.angles)
    fan_sigma, angle_sigma = np.degrees(fit.fan_sigma), np.degrees(fit.angle_sigma)
    position = fit.laser.position
    lines = [
        f"walls          at {_row(fit.wall_distance_m, 2)} m",
        f"error          {fit.rms_px:.3f} px",
        f"fan            {_row(fan, 3)} ± {_row(fan_sigma, 3)} degrees across, down",
        f"rotation       {_row(angles, 3)} ± {_row(angle_sigma, 3)} degrees roll, pitch, yaw",
        f"position       {_row(position * 1000, 1)} ± {_row(fit.position_sigma_m * 1000, 1)} mm forward, right, down",
        "",
        "for the rig file:",
        f"laser: {{rows: {fit.laser.rows}, columns: {fit.laser.columns}, fan_deg: {fan.mean():.3f}, "
        f"position_m: [{_row(position, 4)}], rotation_deg: [{_row(angles, 3)}]}}",
    ]
    warnings = list(fit.warnings)
    if abs(fan[0] - fan[1]) > 0.2:
        warnings.append(f"a rig file has one fan for both ways: {fan.mean():.2f} degrees stands for {_row(fan, 2)}")
    return "\n".join([*lines, *[f"warning: {warning}" for warning in warnings]]) + "\n"


def coverage_picture(fit: StereoFit) -> NDArray[np.uint8]:
    """Both images side by side (h, w, 3) BGR: cells with corners shaded, and each corner with its error a
    hundredfold."""
    return np.hstack([_coverage(camera) for camera in (fit.left, fit.right)])


def _camera_lines(name: str, fit: CameraFit) -> list[str]:
    camera = fit.camera
    sigma = "" if fit.held else f" ± {fit.focal_sigma_px:.1f}"
    return [
        f"{name} camera",
        f"  focal length   {camera.fx:.1f}, {camera.fy:.1f}{sigma} px",
        f"  centre         {camera.cx:.1f}, {camera.cy:.1f} px",
        f"  distortion     {_row(np.array(camera.distortion), 5)}",
        f"  reprojection   {fit.rms_px:.3f} px, at most {fit.view_rms_px.max():.3f} px a view",
        f"  views          {len(fit.tilt)}, tilted by {np.degrees(fit.tilt.min()):.1f} to "
        f"{np.degrees(fit.tilt.max()):.1f} degrees",
        f"  coverage       {(fit.coverage > 0).mean():.0%} of {CELLS[0]} x {CELLS[1]} cells",
    ]


def _coverage(fit: CameraFit) -> NDArray[np.uint8]:
    width, height = fit.camera.width, fit.camera.height
    scale = SCALE_PX / width
    size = (SCALE_PX, round(height * scale))
    cells = np.where(fit.coverage > 0, 225, 250).astype(np.uint8)
    picture = cv2.cvtColor(cv2.resize(cells, size, interpolation=cv2.INTER_NEAREST), cv2.COLOR_GRAY2BGR)
    for column in range(1, CELLS[0]):
        u = round(column * size[0] / CELLS[0])
        cv2.line(picture, (u, 0), (u, size[1]), (200, 200, 200), 1)
    for row in range(1, CELLS[1]):
        v = round(row * size[1] / CELLS[1])
        cv2.line(picture, (0, v), (size[0], v), (200, 200, 200), 1)
    for corner, residual in zip(fit.corners * scale, fit.residuals * 100 * scale, strict=True):
        start, end = (tuple(round(float(c)) for c in p) for p in (corner, corner + residual))
        cv2.line(picture, start, end, (40, 40, 220), 1, cv2.LINE_AA)
        cv2.circle(picture, start, 2, (160, 80, 0), -1, cv2.LINE_AA)
    edge = (90, 90, 90)
    cv2.rectangle(picture, (0, 0), (size[0] - 1, size[1] - 1), edge, 1)
    framed = cv2.copyMakeBorder(picture, MARGIN, MARGIN, MARGIN, MARGIN, cv2.BORDER_CONSTANT, value=(255, 255, 255))
    return np.asarray(framed, np.uint8)


def _number(value: float, width: int, digits: int = 3) -> str:
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else f"{'-':>{width}}"


def _angles(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Roll, pitch, yaw (3,) of a rotation, as `vision.capture.rotation_of` takes them."""
    pitch = -np.arcsin(np.clip(rotation[2, 0], -1, 1))
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _row(values: NDArray[np.float64], digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)
