"""The PID controller of standoff and yaw (5.3, 5.8), with its memory passed in and out."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class PidState:
    """integral: in units of the output. error and output: of the last step, None before the first."""

    integral: float = 0.0
    error: float | None = None
    output: float | None = None


@dataclass(frozen=True)
class Pid:
    """Gains per second and second; `limit` bounds the output, `integral_limit` the integral's share, `rate` its change
    a second. The integral does not grow while the output is at its limit and the error would drive it further."""

    p: float
    i: float = 0.0
    d: float = 0.0
    limit: float = inf
    integral_limit: float = inf
    rate: float = inf

    def step(
        self, error: float, elapsed_s: float, state: PidState, error_rate: float | None = None
    ) -> tuple[float, PidState]:
        """The output for this error, `elapsed_s` after the last, and the state to pass next time.

        error_rate: the error's change a second where it is measured; without, the difference to the last error serves.
        """
        change = error_rate
        if change is None:
            change = 0.0 if state.error is None or elapsed_s <= 0 else (error - state.error) / elapsed_s
        integral = _clip(state.integral + self.i * error * elapsed_s, self.integral_limit)
        wanted = self.p * error + integral + self.d * change
        output = _clip(wanted, self.limit)
        if state.output is not None and self.rate < inf:
            output = state.output + _clip(output - state.output, self.rate * elapsed_s)
        if (wanted - output) * error > 0:
            integral = state.integral
        return output, PidState(integral, error, output)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
