"""Whether the tracker's claims held in a run: its innovations against their covariance, its distances against truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mission.record.history import RunHistory

FRESH_S = 0.5  # an estimate older than this is a prediction over a gap, which is judged by itself


def consistency_of(history: RunHistory) -> Mapping[str, Any]:
    """The `tracker` section of a summary: nis_per_dof with the interval in which 95 % of right trackers lie. distance:
    only where the simulated world knows the truth."""
    from vision.consistency import consistency

    used = [line for line in history.cycles if line.get("accepted") and line.get("nis") is not None]
    found = consistency([float(line["nis"]) for line in used], [int(line.get("dof") or 0) for line in used])
    if found is None:
        return {"nis_per_dof": None, "interval": None, "samples": 0}
    section: dict[str, Any] = {
        "nis_per_dof": found.ratio,
        "interval": [found.low, found.high],
        "samples": found.samples,
    }
    if history.folder.truth.is_file():
        section["distance"] = _distance(history)
    return section


def _distance(history: RunHistory) -> Mapping[str, Any] | None:
    """Errors of the believed distance to the blade and the share of them within one and two of the claimed sigmas."""
    from devices.world.run_files import RunFiles, joined
    from devices.world.true_distance import distances_ahead

    try:
        run = joined([run for part in history.parts if (run := RunFiles.read(part.path)) is not None])
    except (ValueError, KeyError, TypeError, IndexError):
        return None  # torn files of a killed run
    believed = [line for line in history.cycles if (line.get("estimate") or {}).get("sigma_m")]
    if run is None or not believed:
        return None
    true = distances_ahead(run.flight, run.shape, run.mount, [float(line["stamp"]) for line in believed])
    error = np.array([line["estimate"]["distance_m"] for line in believed], float) - true
    sigma = np.array([line["estimate"]["sigma_m"] for line in believed], float)
    fresh = np.array([float(line["estimate"]["age_s"]) <= FRESH_S for line in believed])
    followed = np.array([bool(line.get("side")) for line in believed])
    return {
        "all": _covered(error[fresh], sigma[fresh]),
        "following": _covered(error[fresh & followed], sigma[fresh & followed]),
        "bridging": _covered(error[~fresh], sigma[~fresh]),
    }


def _covered(error: Sequence[float] | np.ndarray, sigma: Sequence[float] | np.ndarray) -> Mapping[str, Any] | None:
    known = np.isfinite(error)
    if not known.any():
        return None
    error, sigma = np.asarray(error)[known], np.asarray(sigma)[known]
    within = np.abs(error) / sigma
    return {
        "samples": len(error),
        "rmse_m": float(np.sqrt(np.mean(error**2))),
        "sigma_m": float(np.median(sigma)),
        "within_1_sigma": float(np.mean(within <= 1)),
        "within_2_sigma": float(np.mean(within <= 2)),
    }
