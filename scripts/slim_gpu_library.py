#!/usr/bin/env python3
"""Blanks the code of all GPU architectures but one in a shared library, so that it packs into a tenth.

    slim_gpu_library.py INPUT OUTPUT ARCHITECTURE        ARCHITECTURE: 90 for sm_90

The layout stays: images of other architectures, and PTX, become zeros. For measurements on a machine to which the whole
file cannot be brought; the result is not to be passed on.

A fat binary is a container with a header of 16 bytes (magic, version, header size, size of what follows) and entries,
each with a header that says its kind (1: PTX, 2: machine code), the lengths of header and body, and the architecture.
"""
import struct
import sys

CONTAINER = struct.Struct("<IHHQ")
MAGIC = 0xBA55ED50
MACHINE_CODE = 2
LEAST_ENTRY_HEADER, MOST_ENTRY_HEADER = 64, 4096


def entries(data, begin, end):
    """Yields (kind, architecture, first byte of the body, its length) of each entry of a container."""
    at = begin
    while at + LEAST_ENTRY_HEADER <= end:
        kind, _, header, size = struct.unpack_from("<HHIQ", data, at)
        (architecture,) = struct.unpack_from("<I", data, at + 28)
        well_formed = kind in (1, 2) and LEAST_ENTRY_HEADER <= header <= MOST_ENTRY_HEADER
        if not well_formed or at + header + size > end:
            return
        yield kind, architecture, at + header, size
        at += header + size


def slim(data, wanted):
    """Blanks in place; returns the bytes kept and the bytes blanked."""
    kept = blanked = at = 0
    while (at := data.find(struct.pack("<I", MAGIC), at)) >= 0:
        _, version, header, size = CONTAINER.unpack_from(data, at)
        end = at + header + size
        if version != 1 or header != CONTAINER.size or end > len(data):
            at += 4
            continue
        for kind, architecture, body, length in entries(data, at + header, end):
            if kind == MACHINE_CODE and architecture == wanted:
                kept += length
            else:
                data[body : body + length] = bytes(length)
                blanked += length
        at = end
    return kept, blanked


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as file:
        data = bytearray(file.read())
    kept, blanked = slim(data, int(sys.argv[3]))
    if kept == 0:
        sys.exit(f"{sys.argv[1]}: there is no code for sm_{sys.argv[3]} in it")
    with open(sys.argv[2], "wb") as file:
        file.write(data)
    print(f"kept {kept / 1e6:.1f} MB, blanked {blanked / 1e6:.1f} of {len(data) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
