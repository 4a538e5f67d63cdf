"""A change of the simulation's speed must not change how soon, on the wall's clock, a lost stream is noticed."""

from __future__ import annotations

import pytest

from devices.vehicle.parameters import ParameterTable


@pytest.mark.parametrize("speed", [1.0, 2.5, 10.0])
def test_the_offboard_time_out_follows_the_speed(speed: float) -> None:
    table = ParameterTable({}, time_factor=5.0)
    table.stretch_times(speed / 5.0)
    assert float(table["COM_OF_LOSS_T"]) / speed == pytest.approx(1.0)
