"""Arrays that a thread works in again and again. A fresh array of the size of an image costs a page fault for every
4096 bytes of it, which is more than most of what is done to it."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class _Kept(threading.local):
    def __init__(self) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}


_KEPT = _Kept()


def lent(purpose: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array with whatever is in it, the caller's until the same thread asks again for one for the same purpose:
    nothing that outlives the look at one set of frames may keep it."""
    array = _KEPT.arrays.get(purpose)
    if array is None or array.shape != shape or array.dtype != dtype:
        array = _KEPT.arrays[purpose] = np.empty(shape, dtype)
    return array
