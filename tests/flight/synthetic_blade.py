"""A tapered, twisted, tilted blade and a point-mass vehicle: what guidance is flown against, with the truth known
exactly.

The blade's front is a ruled surface: straight across, twisted along. In blade coordinates (station s, offset n, depth
d) d(s, n) = bend(s) + tan(twist(s)) (n − middle(s)) between the edges."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flight.autopilot import Setpoint, VehiclePose
from flight.guidance.follow import View
from vision.capture import CameraPose, camera_pose, rotation_of
from vision.estimate import BladeEstimate, BladeFrame, SideEstimate
from vision.observation import Line

VIEW = View(612, 512, 616)
MOUNT = np.array([0.12, 0.0, 0.05])


@dataclass(frozen=True)
class SyntheticBlade:
    frame: BladeFrame
    tip_m: float = 40.0

    def chord(self, s):
        return np.interp(s, [1.0, 3.0, 9.0, 39.0, 40.0], [1.9, 2.0, 3.5, 0.6, 0.5])

    def edges(self, s):
        """Offsets of the leading and the trailing edge: the leading one nearly straight, as on real blades."""
        leading = 0.35 * self.chord(s)
        return leading, leading - self.chord(s)

    def twist(self, s):
        return np.deg2rad(np.interp(s, [1.0, 9.0, 40.0], [14.0, 11.0, 0.0]))

    def depth(self, s, n):
        return -0.0006 * s**2 + np.tan(self.twist(s)) * n

    def nearest(self, lens):
        """Distance from a point of local NED to the nearest point of the surface, on a fine grid around it."""
        s0 = self.frame.to_blade(lens)[0]
        s = np.linspace(s0 - 1.5, s0 + 1.5, 31)[:, None]
        leading, trailing = self.edges(s)
        n = trailing + (leading - trailing) * np.linspace(0, 1, 31)[None, :]
        points = np.stack([np.broadcast_to(s, n.shape), n, self.depth(s, n)], axis=-1)
        return float(np.min(np.linalg.norm(points - self.frame.to_blade(lens), axis=-1)))

    def estimate(self, stamp_s: float, camera: CameraPose) -> BladeEstimate:
        """What a perfect tracker says: the tangent plane where the optical axis meets the surface, the edges'
        tangents."""
        origin, axis = self.frame.to_blade(camera.position), self.frame.rotation @ camera.rotation[:, 0]
        reach = 3.0
        for _ in range(30):
            s, n, d = origin + reach * axis
            reach += (self.depth(s, n) - d) / axis[2]
        s, n, _ = origin + reach * axis
        h = 1e-4
        depth_slope = (self.depth(s + h, n) - self.depth(s - h, n)) / (2 * h)
        across_slope = (self.depth(s, n + h) - self.depth(s, n - h)) / (2 * h)
        normal = self.frame.rotation.T @ np.array([depth_slope, across_slope, -1.0])
        sides = []
        for index, sign in ((0, 1.0), (1, -1.0)):
            offset = self.edges(s)[index]
            slope = (self.edges(s + h)[index] - self.edges(s - h)[index]) / (2 * h)
            line, outward = self._line(camera, s, index, sign)
            sides.append(SideEstimate(float(offset), float(slope), 0.01, 0.005, 0.0, line, outward))
        base, ahead = (self._image(camera, station, n) for station in (s, s + 0.1))
        return BladeEstimate(
            stamp_s=stamp_s, age_s=0.0, station_m=float(s), distance_m=float(reach), distance_sigma_m=0.01,
            nearest_m=self.nearest(camera.position), normal=normal / np.linalg.norm(normal),
            point=camera.position + reach * camera.rotation[:, 0], depth_m=float(self.depth(s, n)),
            depth_slope=float(depth_slope), across_slope=float(across_slope), leading=sides[0], trailing=sides[1],
            heading=float(np.arctan2(*(ahead - base)[::-1])), heading_sigma=0.01, chord_m=float(self.chord(s)),
            chord_sigma_m=0.02, state=np.zeros(0), covariance=np.zeros((0, 0)),
        )  # fmt: skip

    def _image(self, camera: CameraPose, s, n):
        x, y, z = camera.from_ned(self.frame.to_ned(np.array([s, n, self.depth(s, n)])))
        return VIEW.focal_px * np.array([y, z]) / x

    def _line(self, camera, s, index, sign):
        a, b = (self._image(camera, station, self.edges(station)[index]) for station in (s - 0.05, s + 0.05))
        along = (b - a) / np.linalg.norm(b - a)
        across = self._image(camera, s, self.edges(s)[index] + sign * 0.01) - self._image(
            camera, s, self.edges(s)[index]
        )
        outward = across - (across @ along) * along
        outward /= np.linalg.norm(outward)
        rho = float(a @ outward)
        theta = float(np.arctan2(outward[1], outward[0])) + (np.pi if rho < 0 else 0.0)
        return Line(theta, abs(rho)), outward

    def edge_in_view(self, camera: CameraPose, side: str) -> bool:
        """Whether any of the edge beside the camera's station is inside the image."""
        s = self.frame.to_blade(camera.position)[0] + np.linspace(-1.5, 1.5, 61)
        n = self.edges(s)[0 if side == "leading" else 1]
        x, y, z = camera.from_ned(self.frame.to_ned(np.stack([s, n, self.depth(s, n)], axis=1))).T
        pixels = VIEW.focal_px * np.stack([y / x, z / x], axis=1)
        return bool(np.any((abs(pixels[:, 0]) < VIEW.width_px / 2 - 3) & (abs(pixels[:, 1]) < VIEW.height_px / 2 - 3)))


@dataclass
class PointMass:
    """A vehicle as measured: velocity = 0.95 × the way to the setpoint, limited, reached with a lag; a gimbal with a
    lag."""

    position: np.ndarray
    yaw: float
    gimbal: np.ndarray
    gain: float = 0.95
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    stamp_s: float = 0.0

    def pose(self) -> VehiclePose:
        return VehiclePose(
            self.stamp_s, self.position.copy(), self.velocity.copy(), np.array([0.0, 0.0, self.yaw]), self.gimbal.copy()
        )

    def camera(self) -> CameraPose:
        return camera_pose(self.position, np.array([0.0, 0.0, self.yaw]), self.gimbal, MOUNT)

    def step(self, setpoint: Setpoint, gimbal: tuple[float, float], dt: float, wind: np.ndarray | float = 0.0) -> None:
        wanted = self.gain * (setpoint.position - self.position)
        speed = np.linalg.norm(wanted[:2])
        if speed > 8.0:
            wanted[:2] *= 8.0 / speed
        wanted[2] = np.clip(wanted[2], -2.8, 1.5)
        acceleration = np.clip((wanted - self.velocity) / 0.35, -4.0, 4.0) + wind
        self.velocity = self.velocity + acceleration * dt
        self.position = self.position + self.velocity * dt
        self.yaw += float(np.clip((setpoint.yaw - self.yaw + np.pi) % (2 * np.pi) - np.pi, -0.8 * dt, 0.8 * dt))
        turn = (np.array(gimbal) - self.gimbal + np.pi) % (2 * np.pi) - np.pi
        self.gimbal = self.gimbal + turn * min(1.0, dt / 0.25)
        self.stamp_s += dt


def facing(blade: SyntheticBlade, heading: float, station: float, distance: float = 3.2) -> PointMass:
    """A vehicle before the middle of the blade at a station, looking along the turbine's heading."""
    middle = sum(blade.edges(station)) / 2
    lens = blade.frame.to_ned(np.array([station, middle, blade.depth(station, middle) - distance]))
    return PointMass(lens - rotation_of(0, 0, heading) @ MOUNT, heading, np.array([heading, 0.0]))
