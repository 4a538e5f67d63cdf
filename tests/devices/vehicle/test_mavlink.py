"""Over MAVLink the vehicle answers a plain pymavlink client as PX4 was measured to."""

import math
import struct
from collections import Counter

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.modes import Mode

COMPANION = mavlink.MAV_TYPE_ONBOARD_CONTROLLER
GCS = mavlink.MAV_TYPE_GCS
POSITION_ONLY = 0b0000_1001_1111_1000
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3

MEASURED_HZ = {
    "ATTITUDE": 100,
    **dict.fromkeys(("HIGHRES_IMU", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"), 50),
    **dict.fromkeys(("LOCAL_POSITION_NED", "ODOMETRY"), 30),
    **dict.fromkeys(("TIMESYNC", "ALTITUDE", "DISTANCE_SENSOR", "ATTITUDE_TARGET"), 10),
    **dict.fromkeys(("POSITION_TARGET_LOCAL_NED", "SERVO_OUTPUT_RAW", "VFR_HUD"), 10),
    "GPS_RAW_INT": 8,
    **dict.fromkeys(("EXTENDED_SYS_STATE", "SYS_STATUS"), 5),
    **dict.fromkeys(("ESTIMATOR_STATUS", "SCALED_PRESSURE", "SYSTEM_TIME", "MISSION_CURRENT"), 1),
    **dict.fromkeys(("BATTERY_STATUS", "CURRENT_MODE", "HOME_POSITION", "VIBRATION"), 0.5),
}


def setpoint(n, e, d, yaw=0.0):
    nothing = (0.0,) * 6
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY, n, e, d, *nothing, yaw, 0.0
    )


def test_streams_flow_unasked_at_the_measured_rates(pilot, client):
    p = pilot()
    p.vehicle.step(5)
    c = client(p)
    c.heartbeat(COMPANION)
    c.run(10)
    seen = Counter(message.get_type() for message in c.received)
    for name, rate in MEASURED_HZ.items():
        assert seen[name] == pytest.approx(rate * 10, rel=0.03, abs=1.01), name
    autopilot = [m for m in c.messages("HEARTBEAT") if m.get_srcComponent() == 1]
    gimbal = [m for m in c.messages("HEARTBEAT") if m.get_srcComponent() == 154]
    assert len(autopilot) == pytest.approx(10, abs=1)
    assert len(gimbal) == pytest.approx(10, abs=1)
    assert autopilot[0].autopilot == mavlink.MAV_AUTOPILOT_PX4
    assert autopilot[0].type == mavlink.MAV_TYPE_QUADROTOR


def test_nothing_is_sent_before_a_client_is_known(pilot, client):
    c = client(pilot())
    c.run(2)
    assert not c.received


def test_rates_follow_set_message_interval(pilot, client):
    c = client(pilot())
    c.heartbeat(COMPANION)
    assert c.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 1e5) == [ACCEPTED]
    assert c.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, -1) == [ACCEPTED]
    assert c.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 9999, 1e5) == [DENIED]
    c.received.clear()
    c.run(5)
    assert len(c.messages("CURRENT_MODE")) == pytest.approx(50, abs=2)
    assert not c.messages("ATTITUDE")


def test_messages_come_on_request_and_unknown_ones_are_denied(pilot, client):
    p = pilot()
    p.vehicle.step(5)
    c = client(p)
    for number, name in ((148, "AUTOPILOT_VERSION"), (242, "HOME_POSITION"), (435, "AVAILABLE_MODES")):
        assert c.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number) == [ACCEPTED]
        assert c.messages(name), name
    assert c.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 12345) == [DENIED]
    assert c.command(mavlink.MAV_CMD_IMAGE_START_CAPTURE) == [UNSUPPORTED]
    version = c.messages("AUTOPILOT_VERSION")[0].flight_sw_version
    assert (version >> 24, version >> 16 & 0xFF) == (1, 17)


def test_health_bits_and_home_appear_with_the_position(pilot, client):
    p = pilot()
    c = client(p)
    c.heartbeat(COMPANION)
    c.run(3)
    assert not c.messages("HOME_POSITION")
    early = c.messages("SYS_STATUS")[-1].onboard_control_sensors_health
    assert not early & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    c.run(4)
    late = c.messages("SYS_STATUS")[-1].onboard_control_sensors_health
    assert late & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert late & mavlink.MAV_SYS_STATUS_SENSOR_GPS
    assert c.messages("HOME_POSITION")


def test_a_flight_by_commands_alone(pilot, client):
    p = pilot()
    c = client(p)
    assert c.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [REJECTED]
    c.run(5)
    assert c.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    assert c.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, 488 + 8.0) == [ACCEPTED]
    c.run(15)
    assert c.messages("EXTENDED_SYS_STATE")[-1].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    assert c.messages("GLOBAL_POSITION_INT")[-1].relative_alt / 1e3 == pytest.approx(8, abs=0.3)
    assert c.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == [REJECTED]
    north_deg = 47.397742 + 10 / 111_194.9
    assert c.command(mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, 0, north_deg, 8.545594, 488 + 12) == [ACCEPTED]
    c.run(12)
    assert c.messages("LOCAL_POSITION_NED")[-1].x == pytest.approx(10, abs=0.5)
    assert c.messages("LOCAL_POSITION_NED")[-1].z == pytest.approx(-12, abs=0.5)
    assert c.command(mavlink.MAV_CMD_NAV_LAND) == [ACCEPTED]
    c.run(25)
    assert c.messages("EXTENDED_SYS_STATE")[-1].landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert not c.messages("HEARTBEAT")[-1].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_a_mode_change_is_acknowledged_twice_and_the_second_counts(pilot, client):
    p = pilot().airborne()
    c = client(p)
    assert c.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *Mode.OFFBOARD.value) == [ACCEPTED, REJECTED]
    c.send(setpoint(0, 0, -10))
    assert c.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *Mode.OFFBOARD.value) == [ACCEPTED, ACCEPTED]
    c.run(0.5)
    assert p.firmware.mode is Mode.OFFBOARD


def test_offboard_setpoints_fly_it(pilot, client):
    p = pilot().airborne()
    c = client(p)
    for _ in range(160):
        c.send(setpoint(4, -3, -12, yaw=0.7))
        p.firmware.set_mode(Mode.OFFBOARD)
        c.run(0.05)
    assert c.setpoints == 160
    place = c.messages("LOCAL_POSITION_NED")[-1]
    assert (place.x, place.y, place.z) == pytest.approx((4, -3, -12), abs=0.2)
    assert c.messages("ATTITUDE")[-1].yaw == pytest.approx(0.7, abs=0.03)
    assert c.messages("CURRENT_MODE")[-1].custom_mode == Mode.OFFBOARD.custom


def test_texts_go_to_ground_stations_alone(pilot, client):
    p = pilot()
    companion, station = client(p), client(p, role="gcs", source=(255, 190))
    companion.heartbeat(COMPANION)
    station.heartbeat(GCS)
    p.firmware.arm()
    companion.run(0.1)
    station.run(0.1)
    assert not companion.messages("STATUSTEXT")
    assert "Arming denied" in station.messages("STATUSTEXT")[0].text


def test_parameters_can_be_listed_read_and_set(pilot, client):
    p = pilot()
    c = client(p)
    c.send(mavlink.MAVLink_param_request_list_message(1, 1))
    c.run(0.2)
    values = {m.param_id: m for m in c.messages("PARAM_VALUE")}
    assert len(values) == values["COM_OF_LOSS_T"].param_count == len(p.firmware.parameters)
    assert values["COM_OF_LOSS_T"].param_value == 1.0
    assert values["COM_OBL_RC_ACT"].param_type == mavlink.MAV_PARAM_TYPE_INT32
    assert struct.unpack("<i", struct.pack("<f", values["COM_OBL_RC_ACT"].param_value))[0] == 5
    four = struct.unpack("<f", struct.pack("<i", 4))[0]
    c.send(mavlink.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", four, mavlink.MAV_PARAM_TYPE_INT32))
    assert p.firmware.parameters["COM_OBL_RC_ACT"] == 4
    c.received.clear()
    c.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH_PARAM", -1))
    assert not c.messages("PARAM_VALUE")


def test_it_has_no_mission_answers_time_and_pings(pilot, client):
    p = pilot()
    p.vehicle.step(1)
    c = client(p)
    c.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert c.messages("MISSION_COUNT")[0].count == 0
    c.send(mavlink.MAVLink_timesync_message(0, 123_456))
    answer = c.messages("TIMESYNC")[0]
    assert (answer.tc1, answer.ts1) == (1_000_000_000, 123_456)


def test_the_gimbal_obeys_only_after_control_was_taken(pilot, client):
    p = pilot()
    c = client(p)
    c.heartbeat(COMPANION)
    lock = mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK
    aim = (mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, 10.0, 20.0, math.nan, math.nan, lock, 0, 0)
    assert c.command(*aim) == [DENIED]
    assert c.command(mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, 1, 195, -1, -1) == [ACCEPTED]
    assert c.command(*aim) == [ACCEPTED]
    c.run(2)
    status = c.messages("GIMBAL_DEVICE_ATTITUDE_STATUS")[-1]
    w, x, y, z = status.q
    assert status.get_srcComponent() == 154
    assert math.degrees(math.asin(2 * (w * y - z * x))) == pytest.approx(10, abs=0.3)
    assert math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))) == pytest.approx(20, abs=0.3)
    manager = c.messages("GIMBAL_MANAGER_STATUS")[-1]
    assert (manager.primary_control_sysid, manager.primary_control_compid) == (1, 195)
    assert c.messages("GIMBAL_MANAGER_INFORMATION")[-1].gimbal_device_id == 154


def test_the_gimbal_is_silent_unless_the_parameter_says_otherwise(pilot, client):
    p = pilot(parameters={"MNT_MODE_IN": 0})
    c = client(p)
    c.heartbeat(COMPANION)
    c.run(6)
    assert not [m for m in c.received if "GIMBAL" in m.get_type() or m.get_srcComponent() == 154]


def test_a_cut_link_carries_nothing_either_way(pilot, client):
    p = pilot().airborne()
    c = client(p)
    c.heartbeat(COMPANION)
    c.link.up = False
    c.received.clear()
    assert c.command(mavlink.MAV_CMD_NAV_LAND) == []
    c.run(1)
    assert not c.received
    assert p.firmware.mode is Mode.HOLD


def test_rubbish_and_strangers_messages_do_no_harm(pilot, client):
    p = pilot()
    p.vehicle.step(5)
    c = client(p)
    c._socket.sendto(b"\xfd\x09rubbish" * 30, ("127.0.0.1", c.link.port))
    c.send(mavlink.MAVLink_command_long_message(77, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0))
    assert not p.firmware.armed
    assert c.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]


def test_no_message_however_absurd_breaks_it(pilot, client):
    p = pilot().airborne()
    c = client(p)
    rng = np.random.default_rng(5)
    odd = struct.pack("<fffii", math.nan, math.inf, -1e38, -1, 0x7FFFFFFF)
    for name in HANDLED:
        kind = mavlink.mavlink_map[getattr(mavlink, f"MAVLINK_MSG_ID_{name}")]
        for _ in range(60):
            payload = bytearray(rng.bytes(kind.unpacker.size))
            for at in range(0, len(payload) - 4, 4):
                if rng.random() < 0.4:
                    start = 4 * int(rng.integers(5))
                    payload[at : at + 4] = odd[start : start + 4]
            c.send_raw(kind.id, kind.crc_extra, aimed(kind, payload))
            c.run(0.02)
    for command in range(0, 2600):
        c.command(command, *rng.choice([math.nan, math.inf, 0.0, 1.0, 6.0, 1e30], 7))
    c.run(1)
    assert np.isfinite([*p.vehicle.pose().position, *p.vehicle.pose().attitude]).all()


HANDLED = (
    *("HEARTBEAT", "COMMAND_LONG", "COMMAND_INT", "SET_MODE", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"),
    *("SET_POSITION_TARGET_LOCAL_NED", "TIMESYNC", "PING", "MISSION_REQUEST_LIST", "MISSION_COUNT"),
    *("MISSION_CLEAR_ALL", "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE"),
    *("GIMBAL_MANAGER_SET_ATTITUDE", "GIMBAL_MANAGER_SET_PITCHYAW"),
)


def aimed(kind, payload):
    """The payload with the vehicle as its target, where the message has one."""
    values = list(kind.unpacker.unpack(bytes(payload)))
    for index, field in enumerate(kind.ordered_fieldnames):
        if field in ("target", "target_system", "target_component") and index < len(values):
            values[index] = 1
    return kind.unpacker.pack(*values)


def test_wind_and_range_are_reported(pilot, client):
    p = pilot(wind={"mean_m_s": 6, "gust_m_s": 6, "from_deg": 180})
    p.vehicle.forward_range = lambda position, attitude: 9.0
    p.airborne()
    c = client(p)
    c.heartbeat(COMPANION)
    c.run(2)
    assert c.messages("WIND_COV")[-1].wind_x == pytest.approx(6, abs=0.3)
    assert c.messages("DISTANCE_SENSOR")[-1].current_distance == pytest.approx(900, abs=10)
    p.vehicle.forward_range = None
    c.run(1)
    beyond = c.messages("DISTANCE_SENSOR")[-1]
    assert beyond.current_distance > beyond.max_distance
