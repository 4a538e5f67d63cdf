"""When the rehearsed faults are on."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from devices.world import settings
from devices.world.faults import FaultSchedule
from devices.world.settings import Faults, WorldSettings


def on(schedule: FaultSchedule, name: str, times: list[float]) -> list[bool]:
    return [schedule.active(name, t) for t in times]


def test_a_periodic_drop_out_takes_the_last_seconds_of_each_period():
    schedule = FaultSchedule(Faults.model_validate({"images": {"every_s": 20, "for_s": 2}}))
    assert on(schedule, "images", [0, 17.9, 18, 19.9, 20, 37.9, 38.1]) == [False, False, True, True, False, False, True]


def test_a_fault_waits_for_the_first_entry_of_its_state():
    schedule = FaultSchedule(
        Faults.model_validate({"blackout": {"state": "inspect.leading", "after_s": 10, "for_s": 15}})
    )
    assert not schedule.active("blackout", 500)
    schedule.enter_state("inspect.survey", 20)
    assert not schedule.active("blackout", 500)
    schedule.enter_state("inspect.leading", 100)
    schedule.enter_state("inspect.leading", 300)
    assert on(schedule, "blackout", [109.9, 110, 124.9, 125, 311]) == [False, True, True, False, False]


def test_a_fault_tied_to_a_composite_state_begins_with_the_first_state_inside_it():
    schedule = FaultSchedule(Faults.model_validate({"laser_off": {"state": "inspect"}}))
    schedule.enter_state("inspect.survey", 30)
    schedule.enter_state("inspect.leading", 90)
    assert on(schedule, "laser_off", [29, 30, 1e6]) == [False, True, True]


def test_a_fault_with_nothing_said_of_when_is_on_from_the_start():
    schedule = FaultSchedule(Faults.model_validate({"range_finder": {}, "left_eye": {"at_s": 5, "for_s": 1}}))
    assert on(schedule, "range_finder", [0, 1e4]) == [True, True]
    assert on(schedule, "left_eye", [0, 5.5, 6.1]) == [False, True, False]
    assert not schedule.active("images", 0)


@pytest.mark.parametrize("window", [{"at_s": 1, "state": "a"}, {"every_s": 2, "for_s": 2}, {"for_s": 0}, {"when": 1}])
def test_a_window_that_makes_no_sense_is_refused(window):
    with pytest.raises(ValidationError):
        Faults.model_validate({"images": window})


def test_every_setting_of_the_world_is_documented():
    def undocumented(schema: dict, path: str) -> list[str]:
        return [
            f"{path}.{name}"
            for name, field in schema.get("properties", {}).items()
            if not (field.get("description") or "$ref" in field)
        ]

    schema = WorldSettings.model_json_schema()
    missing = undocumented(schema, "world")
    for name, section in schema["$defs"].items():
        assert section.get("description"), name
        missing += undocumented(section, name)
    assert [path for path in missing if path != "world.seed"] == []


def test_every_fault_is_in_the_table_that_users_read():
    table = (Path(settings.__file__).parent / "README.md").read_text("utf-8")
    assert [name for name in Faults.model_fields if f"\n| `{name}` |" not in table] == []
