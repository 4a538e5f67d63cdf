"""The one way inner loops are compiled, the eye's and the simulated world's: cached on disk, releasing the interpreter
lock, IEEE arithmetic in the order written, so that the same input gives the same output bit for bit.

What is kept on disk is compiled again when its own module changes, not when another does: a kernel calls only kernels
of its module. Where no folder can be written to (neither beside the module nor the user's cache), every process
compiles for itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """A function of arrays and numbers as machine code, from its first call on."""
    kernel: F
    try:
        kernel = numba.njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # numba found nowhere to keep it
        kernel = numba.njit(**OPTIONS)(function)
    return kernel
