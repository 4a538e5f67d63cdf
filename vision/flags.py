"""Tables by which compiled loops go through flags, eight at a time, without asking each."""

from __future__ import annotations

import numpy as np

GATHER = np.uint64(0x0102040810204080)
"""Eight bytes of one or zero, times this, have their lowest bits in the highest byte, the first one's lowest."""
NUMBER = np.array([bin(byte).count("1") for byte in range(256)])
"""How many bits are set in a byte."""
SET = np.zeros((256, 8), np.uint8)
"""And which these are, the first ones first."""
for _byte in range(256):
    SET[_byte, : NUMBER[_byte]] = [bit for bit in range(8) if _byte >> bit & 1]
