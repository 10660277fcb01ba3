#!/usr/bin/env python3
"""Open a recording of otolith with readers that know nothing of otolith.

Usage: read_mcap.py FILE.mcap      (needs: pip install mcap mcap-ros2-support)

Decodes every message through its embedded schema, checks every checksum the
reader knows, prints the number of messages of each topic and the first message
of /imu. Exit code 0 when /imu and both tick topics were found.
"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    counts = Counter()
    first = {}
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        print("profile", reader.get_header().profile)
        for attachment in reader.iter_attachments():
            print("attachment", attachment.name, len(attachment.data), "bytes")
        for _schema, channel, _message, decoded in reader.iter_decoded_messages():
            counts[channel.topic] += 1
            first.setdefault(channel.topic, decoded)
        stated = reader.get_summary().statistics.message_count
    for topic, count in sorted(counts.items()):
        print(f"{topic} {count}")
    if sum(counts.values()) != stated:
        print(f"read {sum(counts.values())} messages, the file states {stated}", file=sys.stderr)
        return 1
    missing = {"/imu", "/otolith/tick_input", "/otolith/tick_output"} - set(counts)
    if missing:
        print("no messages:", *sorted(missing), file=sys.stderr)
        return 1
    imu = first["/imu"]
    print("frame", imu.header.frame_id, "stamp", imu.header.stamp.sec, imu.header.stamp.nanosec)
    print("orientation_covariance[0]", imu.orientation_covariance[0])
    for name in ("angular_velocity", "linear_acceleration"):
        vector = getattr(imu, name)
        print(name, vector.x, vector.y, vector.z)
    output = first["/otolith/tick_output"]
    print("green believes gravity", output.green.perception.gravity_head.z)
    print("green's soles tilt by", output.green.foot_tilt)
    return 0


if __name__ == "__main__":
    sys.exit(main())
