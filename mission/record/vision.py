"""What vision saw, one line a cycle: vision.jsonl."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.record.row_file import RowFile

if TYPE_CHECKING:
    from vision.estimate import BladeEstimate
    from vision.observation import BladeObservation
    from vision.tracker import UpdateResult


class VisionRecorder:
    """Appends each cycle's observation, what the tracker made of it, and what is believed after it."""

    def __init__(self, path: Path, on_lost: Callable[[str], None] | None = None) -> None:
        self._file = RowFile(path, on_lost=on_lost)

    def record(
        self,
        stamp_s: float,
        observation: BladeObservation,
        update: UpdateResult | None,
        estimate: BladeEstimate | None,
        side: str | None,
    ) -> None:
        """Append one cycle."""
        self._file.json(
            {
                "stamp": stamp_s,
                "side": side,
                "valid": observation.valid,
                "accepted": update is not None and update.accepted,
                "reasons": observation.reasons + (update.reasons if update is not None else ()),
                "distance_m": observation.distance_m,
                "sigma_m": observation.distance_sigma_m,
                "nearest_m": observation.nearest_m,
                "dots": len(observation.points) if observation.points is not None else 0,
                "edges": len(observation.edges),
                "tip": observation.tip is not None,
                "chord_m": observation.chord_m,
                "sharpness": observation.sharpness,
                "nis": update.nis if update is not None else None,
                "dof": update.dof if update is not None else None,
                "elapsed_ms": total_ms(observation.elapsed_ms),
                "estimate": _believed(estimate),
            }
        )

    def gap(self, stamp_s: float, reason: str) -> None:
        """Append a cycle that had no images."""
        self._file.json({"stamp": stamp_s, "valid": False, "accepted": False, "gap": True, "reasons": [reason]})

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def total_ms(elapsed_ms: Mapping[str, float]) -> float | None:
    """Of one cycle, from its stages."""
    if not elapsed_ms:
        return None
    return float(elapsed_ms["total"]) if "total" in elapsed_ms else float(sum(elapsed_ms.values()))


def _believed(estimate: BladeEstimate | None) -> dict[str, Any] | None:
    if estimate is None:
        return None
    return {
        "age_s": estimate.age_s,
        "station_m": estimate.station_m,
        "distance_m": estimate.distance_m,
        "sigma_m": estimate.distance_sigma_m,
        "nearest_m": estimate.nearest_m,
        "chord_m": estimate.chord_m,
        "leading_m": estimate.leading.offset_m if estimate.leading is not None else None,
        "trailing_m": estimate.trailing.offset_m if estimate.trailing is not None else None,
    }
