"""The one way the eye's inner loops are compiled: cached on disk, releasing the interpreter lock, IEEE arithmetic in
the order written, so that the same input gives the same output bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """A function of arrays and numbers as machine code, from its first call on."""
    kernel: F = numba.njit(cache=True, nogil=True)(function)
    return kernel
