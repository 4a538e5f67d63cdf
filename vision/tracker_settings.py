"""What the tracker assumes of blades, vehicles and observations: its numbers, in meaningful units."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrackerSettings:
    """Lengths in metres, angles in radians, slopes in m/m, curvatures in 1/m. Pairs are (near the root, farther out).
    prior_*: how far the survey may be wrong where nothing has been seen. *_curvature: sigmas of how fast slopes
    change along the blade (bend, taper) or across it (camber, a round root), and `twist` of how fast the slope
    across turns along it; recess_m: how far behind the surface an edge lies, which seen from aside shifts it. All
    these are like themselves over `alike_m` of travel. Near the root all that is larger: fully so inside the first
    of `round_within_m`, no more beyond the second (metres of station). drift_m_per_root_s: random walk of the
    vehicle's local position. jitter_s: how long the position's trembling is like itself; its sigma begins with
    claimed_jitter_m and is learnt from what is seen, within jitter_m. turned: how far the camera's reported angles
    may be off all the time, and turned_per_root_s by how much that wanders; claimed_attitude, attitude: of their noise
    from frame to frame, learnt as well; so are the shares of what the eye claims that are new in every frame, within
    `fresh`. surface_*, edge_*: what plane and straight line leave out, added to that; surface_bend: the share of what
    its curvature does within the dots' spread; dots_per_m: by how much of its square a distance may be off (1/m) since
    all dots are a little, as where a round root is taken for flat. gate: share of good measurements that each χ² gate
    lets pass. confirmations: agreeing observations before anything is estimated. After `patience` refused surfaces in a
    row the covariance is inflated at each one by inflation_m and inflation_slope, up to inflation_limit_m; after
    `restart_after` in a row that agree among themselves, within the prior and no deeper than restart_deeper_m behind
    the tracked surface, the tracker starts again from them, as it does with an edge. steepest_edge, largest_chord_m: no
    blade's edges exceed these; they are forgotten. history_s: how late an observation may be.
    """

    prior_depth_m: float = 3.0
    prior_depth_slope: float = 0.15
    prior_across_slope: float = 0.6
    prior_offset_m: float = 3.0
    prior_offset_slope: float = 0.3
    depth_curvature: tuple[float, float] = (0.02, 0.003)
    across_curvature: tuple[float, float] = (0.4, 0.2)
    twist: tuple[float, float] = (0.1, 0.015)
    leading_curvature: tuple[float, float] = (0.1, 0.0015)
    trailing_curvature: tuple[float, float] = (0.3, 0.003)
    recess_m: tuple[float, float] = (0.25, 0.017)
    alike_m: tuple[float, float] = (2.0, 6.0)
    alike_across_m: tuple[float, float] = (0.1, 0.1)
    round_within_m: tuple[float, float] = (7.0, 16.0)
    drift_m_per_root_s: float = 0.02
    jitter_s: float = 0.2
    claimed_jitter_m: float = 0.01
    jitter_m: tuple[float, float] = (0.002, 0.15)
    turned: float = 0.02
    turned_per_root_s: float = 0.0005
    claimed_attitude: float = 0.0015
    attitude: tuple[float, float] = (0.0002, 0.01)
    surface_sigma_m: float = 0.0003
    surface_slope_sigma: float = 0.0002
    dots_per_m: tuple[float, float] = (0.0003, 0.00014)
    surface_bend: tuple[float, float] = (0.05, 0.025)
    claimed_fresh: float = 1.0
    fresh: tuple[float, float] = (0.15, 3.0)
    edge_sigma_m: tuple[float, float] = (0.002, 0.0005)
    edge_slope_sigma: tuple[float, float] = (0.002, 0.00005)
    gate: float = 0.997
    confirmations: int = 2
    patience: int = 3
    inflation_m: float = 0.1
    inflation_slope: float = 0.03
    inflation_limit_m: float = 0.25
    restart_after: int = 6
    restart_deeper_m: float = 1.0
    steepest_edge: tuple[float, float] = (0.6, 0.3)
    largest_chord_m: float = 6.0
    history_s: float = 1.0
