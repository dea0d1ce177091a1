# SPDX-License-Identifier: GPL-3.0-or-later
"""The log of a day: drops that were simulated, written again under other numbers and at other times, as a tower would have
sent them. What changes of a frame changes its checksum with it; the samples stay."""
import zlib


def crc8(data):
    """CRC-8, polynomial 0x2F, without what it begins and ends with: linear, so that a change of a byte tells its own part."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 & 0xFF) ^ (0x2F if crc & 0x80 else 0)
    return crc


# what a change of drop number or tick does to a block's CRC-8, by place and difference; 62 of its bytes follow the first
EFFECT = [[crc8(bytes([change]) + bytes(62 - place)) for change in range(256)] for place in range(6)]


def sealed(data):
    return data + zlib.crc32(data).to_bytes(4, "little")


class Drop:
    """The frames around a capture end."""

    def __init__(self, lines, end):
        self.number = int.from_bytes(bytes.fromhex(lines[end].split(b"##1")[1][:4].decode()), "little")
        self.frames = []
        for line in lines[max(0, end - 2100):end + 300]:
            stamp, bus, text = line.split()
            ident, data = text[:3], bytes.fromhex(text.rsplit(b"#", 1)[1][text[4:5] == b"#":].decode())
            self.frames.append((int(stamp[1:-1].replace(b".", b"")), bus, ident, text[3:len(text) - 2 * len(data)], data))

    def again(self, number, at_us):
        """As lines, with that drop number, beginning at that time (whole milliseconds later, whatever is asked)."""
        later_ms = (at_us - self.frames[0][0]) // 1000

        def tick(data, i):
            return (int.from_bytes(data[i:i + 4], "little") + later_ms).to_bytes(4, "little")

        def drop(data):
            return (int.from_bytes(data[:2], "little") - self.number + number).to_bytes(2, "little")

        for us, bus, ident, mark, data in self.frames:
            if ident in (b"181", b"281"):
                head, crc = drop(data) + tick(data, 2), data[9]
                for place in range(6):
                    crc ^= EFFECT[place][head[place] ^ data[place]]
                data = head + data[6:9] + bytes([crc]) + data[10:]
            elif ident == b"681":
                data = sealed(drop(data) + data[2:4] + tick(data, 4) + tick(data, 8) + data[12:28])
            elif ident == b"686":
                data = sealed(drop(data) + data[2:20])
            elif ident == b"687":
                data = drop(data) + data[2:]
            elif ident == b"100":
                data = tick(data, 0) + data[4:]
            us += 1000 * later_ms
            yield b"(%d.%06d) %s %s%s%s\n" % (us // 1000000, us % 1000000, bus, ident, mark, data.hex().upper().encode())
