#!/usr/bin/env python3
"""Writes the JSON files beside it: random CAN frames and what cantools reads in them.

Needs `pip install cantools`; run from anywhere. torture.dbc is written too: signals of every length, place, order and kind.
"""
import json
import pathlib
import random
import struct

import cantools

HERE = pathlib.Path(__file__).parent
ROOT = HERE.parents[2]
FRAMES = 24  # for each message, or each value of its switch
EXTENDED = 1 << 31


def torture_dbc(rng):
    """Messages of one signal each and some multiplexed ones, at random places."""
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: A B", ""]
    floats = []

    def signal(name, length, big, signed, mux=""):
        start = rng.randrange(0, 64 - length + 1)
        if big:  # counted along the wire, then written as DBC numbers the most significant bit
            start = start // 8 * 8 + 7 - start % 8
        factor = rng.choice([1, 0.5, 0.001, -0.25, 2.5e-05, 1000])
        offset = rng.choice([0, 0, -40, 0.125, 1e6])
        return f' SG_ {name} {mux}: {start}|{length}@{0 if big else 1}{"-" if signed else "+"} ({factor},{offset}) [0|0] "" B'

    identifier = 1
    for length in [*range(1, 33), 40, 47, 48, 63, 64]:
        for big in (False, True):
            for signed in (False, True):
                flag = EXTENDED | 0x18F00000 if identifier % 3 == 0 else 0
                lines += [f"BO_ {flag | identifier} M{identifier}: 8 A", signal("S", length, big, signed), ""]
                identifier += 1
    for length, kind in ((32, 1), (64, 2)):
        for big in (False, True):
            for flag in (0, EXTENDED | 0x0CF00000):
                lines += [f"BO_ {flag | identifier} M{identifier}: 8 A", signal("S", length, big, True), ""]
                floats.append(f"SIG_VALTYPE_ {flag | identifier} S : {kind};")
                identifier += 1
    for big in (False, True):
        lines += [f"BO_ {identifier} M{identifier}: 8 A"]
        lines += [f' SG_ SWITCH M : {7 if big else 0}|8@{0 if big else 1}+ (1,0) [0|0] "" B']
        for value in (0, 1, 7):
            lines += [f' SG_ A{value} m{value} : {15 if big else 8}|16@{0 if big else 1}- (0.5,{value}) [0|0] "" B']
        lines += [f' SG_ ALWAYS : {39 if big else 32}|12@{0 if big else 1}+ (1,0) [0|0] "" B', ""]
        identifier += 1
    return "\n".join(lines + floats) + "\n"


def payload(rng, message, switch):
    """Random bytes; floats drawn as numbers, so that they are finite."""
    data = bytearray(rng.randrange(256) for _ in range(message.length))
    if switch is not None:
        data[0] = switch
    for signal in message.signals:
        if signal.is_float:
            kind = {32: "f", 64: "d"}[signal.length]
            value = rng.choice([0.0, -1.5, rng.uniform(-1e3, 1e3), rng.uniform(-1, 1) * 1e-6])
            little, big = struct.pack("<" + kind, value), struct.pack(">" + kind, value)
            bits = int.from_bytes(big, "big")
            if signal.byte_order == "big_endian":
                first = signal.start // 8 * 8 + 7 - signal.start % 8
                word = int.from_bytes(bytes(data), "big")
                shift = 64 - first - signal.length
                order = "big"
            else:
                word = int.from_bytes(bytes(data), "little")
                shift = signal.start
                order = "little"
            mask = ((1 << signal.length) - 1) << shift
            data = bytearray(((word & ~mask) | (bits << shift)).to_bytes(8, order))
    return bytes(data)


def frames(rng, database):
    for message in database.messages:
        switches = [None]
        if message.is_multiplexed():
            (switch,) = [signal for signal in message.signals if signal.is_multiplexer]
            assert switch.length == 8 and switch.start in (0, 7)
            switches = sorted({value for signal in message.signals for value in signal.multiplexer_ids or []})
        for switch in switches:
            for _ in range(FRAMES if len(database.messages) < 50 else 4):
                data = payload(rng, message, switch)
                values = message.decode(data, decode_choices=False)
                yield {
                    "id": message.frame_id,
                    "extended": message.is_extended_frame,
                    "data": data.hex(),
                    "signals": {name: float(value) for name, value in values.items()},
                }


def main():
    (HERE / "torture.dbc").write_text(torture_dbc(random.Random(1)))
    files = sorted((ROOT / "configs/can").glob("*.dbc"))
    files += [ROOT / "firmware-protocol/otolith.dbc", HERE / "torture.dbc"]
    for number, path in enumerate(files):
        database = cantools.database.load_file(path)
        golden = {
            "dbc": str(path.relative_to(ROOT)),
            "source": f"cantools {cantools.__version__}",
            "frames": list(frames(random.Random(number), database)),
        }
        lines = ",\n".join(json.dumps(frame) for frame in golden.pop("frames"))
        head = json.dumps(golden)[:-1]
        (HERE / f"{path.stem}.json").write_text(f'{head}, "frames": [\n{lines}\n]}}\n')
        print(path.stem, lines.count("\n") + 1)


if __name__ == "__main__":
    main()
