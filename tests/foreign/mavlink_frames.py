#!/usr/bin/env python3
"""MAVLink frames by an encoder that knows nothing of otolith.

Usage: mavlink_frames.py > tests/golden/devices/mavlink-frames.json      (needs: pip install pymavlink)
"""

import io, json, os
os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import ardupilotmega as m2
from pymavlink.dialects.v10 import ardupilotmega as m1
import pymavlink

def link(dialect, system, component, seq):
    mav = dialect.MAVLink(io.BytesIO(), srcSystem=system, srcComponent=component)
    mav.seq = seq
    return mav

rows = []
def add(name, mav, message, note=None, **expect):
    row = {"name": name, "hex": bytes(message.pack(mav)).hex(), "expect": expect}
    if note: row["note"] = note
    rows.append(row)

raw = dict(time_usec=123456789012, xacc=-12, yacc=34, zacc=-1001, xgyro=1047, ygyro=-2, zgyro=3, xmag=5, ymag=-6, zmag=7)
e_raw = dict(time_us=123456789012, force_mg=[-12, 34, -1001], rate_mrad_s=[1047, -2, 3])
add("raw_imu/extensions", link(m2, 7, 1, 250), m2.MAVLink_raw_imu_message(**raw, id=2, temperature=2150), **e_raw)
add("raw_imu/cut", link(m2, 7, 1, 251), m2.MAVLink_raw_imu_message(**{**raw, "xmag": 0, "ymag": 0, "zmag": 0}),
    "zeros at the end are cut off", **e_raw)
add("raw_imu/version 1", link(m1, 7, 1, 252), m1.MAVLink_raw_imu_message(**raw), **e_raw)
sc = dict(time_boot_ms=4294967290, xacc=1, yacc=2, zacc=-999, xgyro=-100, ygyro=200, zgyro=-300, xmag=0, ymag=0, zmag=0)
e_sc = dict(time_us=4294967290000, force_mg=[1, 2, -999], rate_mrad_s=[-100, 200, -300])
add("scaled_imu", link(m2, 1, 1, 0), m2.MAVLink_scaled_imu_message(**sc), **e_sc)
add("scaled_imu2", link(m2, 1, 1, 0), m2.MAVLink_scaled_imu2_message(**sc, temperature=-1), **e_sc)
add("scaled_imu3", link(m2, 1, 1, 0), m2.MAVLink_scaled_imu3_message(**sc), **e_sc)
hi = dict(time_usec=1_000_000, xacc=0.5, yacc=-0.25, zacc=-9.75, xgyro=0.125, ygyro=-0.5, zgyro=1.0, xmag=0, ymag=0, zmag=0,
          abs_pressure=1013.25, diff_pressure=0, pressure_alt=100, temperature=20)
e_hi = dict(time_us=1_000_000, force=[0.5, -0.25, -9.75], rate=[0.125, -0.5, 1.0])
add("highres_imu", link(m2, 1, 1, 0), m2.MAVLink_highres_imu_message(**hi, fields_updated=0x3F), **e_hi)
add("highres_imu/version 1", link(m1, 1, 1, 0), m1.MAVLink_highres_imu_message(**hi, fields_updated=0xFFF), **e_hi)
add("highres_imu/accelerometer only", link(m2, 1, 1, 0), m2.MAVLink_highres_imu_message(**hi, fields_updated=0x07), half=True)
add("highres_imu/magnetometer only", link(m2, 1, 1, 0), m2.MAVLink_highres_imu_message(**hi, fields_updated=0x1C0))
signed = link(m2, 7, 1, 3)
signed.signing.secret_key = bytes(range(32)); signed.signing.sign_outgoing = True; signed.signing.timestamp = 99
add("raw_imu/signed", signed, m2.MAVLink_raw_imu_message(**raw), **e_raw)
add("heartbeat/ardupilot", link(m2, 7, 1, 4), m2.MAVLink_heartbeat_message(2, 3, 81, 0, 4, 3))
add("heartbeat/px4", link(m2, 7, 1, 4), m2.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3))

class Foreign(m2.MAVLink_raw_imu_message):
    id = 54321
    crc_extra = 77
f = Foreign(**raw); f._header.msgId = 54321
add("message of another dialect", link(m2, 7, 1, 5), f, "id 54321, crc_extra 77", unknown=True)
print(json.dumps({"made_with": f"pymavlink {pymavlink.__version__}: python3 tests/foreign/mavlink_frames.py > tests/golden/devices/mavlink-frames.json",
                  "frames": rows}, indent=1))
