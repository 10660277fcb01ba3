#!/usr/bin/env python3
"""VectorNav binary frames, from the field types in the manuals' tables; it knows nothing of otolith.

Usage: vectornav_frames.py > tests/golden/devices/vectornav-frames.json

No capture of a device was at hand. The field sizes follow from the types here and are listed as numbers in the decoder,
so that the two tables check each other; the checksum is that of Python's binascii.
"""

import binascii
import json
import struct

VECTOR, UTC = "3f", "bBBBBBH"
GNSS = [("Utc", UTC), ("Tow", "Q"), ("Week", "H"), ("NumSats", "B"), ("Fix", "B"), ("PosLla", "3d"), ("PosEcef", "3d"),
        ("VelNed", VECTOR), ("VelEcef", VECTOR), ("PosU", VECTOR), ("VelU", "f"), ("TimeU", "f"), ("TimeInfo", "BB"),
        ("Dop", "7f")]
GROUPS = [
    [("TimeStartup", "Q"), ("TimeGps", "Q"), ("TimeSyncIn", "Q"), ("YawPitchRoll", VECTOR), ("Quaternion", "4f"),
     ("AngularRate", VECTOR), ("Position", "3d"), ("Velocity", VECTOR), ("Accel", VECTOR), ("Imu", "6f"),
     ("MagPres", "5f"), ("DeltaThetaVel", "7f"), ("InsStatus", "H"), ("SyncInCnt", "I"), ("TimeGpsPps", "Q")],
    [("TimeStartup", "Q"), ("TimeGps", "Q"), ("GpsTow", "Q"), ("GpsWeek", "H"), ("TimeSyncIn", "Q"),
     ("TimeGpsPps", "Q"), ("TimeUtc", UTC), ("SyncInCnt", "I"), ("SyncOutCnt", "I"), ("TimeStatus", "B")],
    [("ImuStatus", "H"), ("UncompMag", VECTOR), ("UncompAccel", VECTOR), ("UncompGyro", VECTOR), ("Temp", "f"),
     ("Pres", "f"), ("DeltaTheta", "4f"), ("DeltaVel", VECTOR), ("Mag", VECTOR), ("Accel", VECTOR),
     ("AngularRate", VECTOR), ("SensSat", "H")],
    GNSS,
    [("VpeStatus", "H"), ("YawPitchRoll", VECTOR), ("Quaternion", "4f"), ("Dcm", "9f"), ("MagNed", VECTOR),
     ("AccelNed", VECTOR), ("LinearAccelBody", VECTOR), ("LinearAccelNed", VECTOR), ("YprU", VECTOR)],
    [("InsStatus", "H"), ("PosLla", "3d"), ("PosEcef", "3d"), ("VelBody", VECTOR), ("VelNed", VECTOR),
     ("VelEcef", VECTOR), ("MagEcef", VECTOR), ("AccelEcef", VECTOR), ("LinearAccelEcef", VECTOR), ("PosU", "f"),
     ("VelU", "f")],
    GNSS,
]


def frame(fields):
    """A frame with the fields of `fields`, a dictionary (group number, name) -> values, None for any."""
    masks, payload = [], b""
    for number, group in enumerate(GROUPS, 1):
        mask = 0
        for bit, (name, types) in enumerate(group):
            if (number, name) not in fields:
                continue
            mask |= 1 << bit
            count = len(struct.unpack("<" + types, bytes(struct.calcsize("<" + types))))
            values = fields[number, name]
            payload += struct.pack("<" + types, *(values if values is not None else range(1, count + 1)))
        masks.append(mask)
    groups = sum(1 << index for index, mask in enumerate(masks) if mask)
    head = bytes([groups]) + b"".join(struct.pack("<H", mask) for mask in masks if mask)
    return b"\xfa" + head + payload + struct.pack(">H", binascii.crc_hqx(head + payload, 0))


FORCE, RATE, TIME = [0.5, -0.25, -9.75], [0.125, -1.5, 2.0], [5_123_456_789]
OTHER = [9.0, 9.0, 9.0]
RECIPES = {
    "what --configure sets": ({(1, "TimeStartup"): TIME, (3, "Accel"): FORCE, (3, "AngularRate"): RATE}, {}),
    "common group": ({(1, "TimeStartup"): TIME, (1, "YawPitchRoll"): None, (1, "AngularRate"): RATE, (1, "Accel"): FORCE}, {}),
    "time from the time group": ({(1, "AngularRate"): RATE, (1, "Accel"): FORCE, (2, "TimeStartup"): TIME,
                                  (2, "TimeUtc"): None}, {}),
    "uncompensated, common group": ({(1, "TimeStartup"): TIME, (1, "Imu"): FORCE + RATE}, {}),
    "uncompensated, IMU group": ({(2, "TimeStartup"): TIME, (3, "UncompMag"): None, (3, "UncompAccel"): FORCE,
                                  (3, "UncompGyro"): RATE, (3, "Temp"): None}, {}),
    "compensated before uncompensated": ({(1, "TimeStartup"): TIME, (1, "Imu"): OTHER + OTHER, (3, "UncompAccel"): OTHER,
                                          (3, "UncompGyro"): OTHER, (3, "Accel"): FORCE, (3, "AngularRate"): RATE}, {}),
    "no time": ({(1, "AngularRate"): RATE, (1, "Accel"): FORCE}, {"time_us": None}),
    "no accelerometer": ({(1, "TimeStartup"): TIME, (1, "AngularRate"): RATE}, {"force": None}),
    "gyroscope saturated": ({(1, "TimeStartup"): TIME, (3, "Accel"): FORCE, (3, "AngularRate"): RATE,
                             (3, "SensSat"): [0x0100]}, {"clipped": True}),
    "magnetometer saturated": ({(1, "TimeStartup"): TIME, (3, "Accel"): FORCE, (3, "AngularRate"): RATE,
                                (3, "SensSat"): [0x0203]}, {}),
    "every documented field": ({(number, name): {"TimeStartup": TIME, "AngularRate": RATE, "Accel": FORCE}.get(name)
                                for number, group in enumerate(GROUPS, 1) for name, _ in group}, {}),
}
ROWS = []
for label, (recipe, changes) in RECIPES.items():
    expect = {"time_us": TIME[0] // 1000, "force": FORCE, "rate": RATE, "clipped": False} | changes
    ROWS.append({"name": label, "hex": frame(recipe).hex(), "expect": expect})
print(json.dumps({"made_with": "python3 tests/foreign/vectornav_frames.py > tests/golden/devices/vectornav-frames.json",
                  "frames": ROWS}, indent=1))
