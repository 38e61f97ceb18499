"""LZF, the compression of binary_compressed PCD files, in pure Python.

The stream is a row of instructions (format of liblzf by Marc Lehmann). A control byte c < 32 is followed by c + 1
literal bytes. Any other control byte copies earlier output: its upper three bits are the length minus 2 (7: the next
byte is added), its lower five bits and the next byte how far back to start, minus 1.
"""

from __future__ import annotations

import numpy as np

#: A copy of 264 bytes takes 3: no LZF stream grows by more than that.
MAX_RATIO = 88

_MAX_LITERALS = 32
_MAX_DISTANCE = 8192
_MAX_MATCH = 264
_SEGMENT = 1 << 20


def decompress(data: bytes, size: int) -> bytes:
    """The `size` bytes that were compressed.

    Never makes more than `size` + 264 bytes, whatever the stream says.

    Raises:
        ValueError: the stream is damaged or does not hold `size` bytes.
    """
    out = bytearray()
    position, end = 0, len(data)
    try:
        while position < end:
            control = data[position]
            position += 1
            if control < _MAX_LITERALS:
                literals = data[position : position + control + 1]
                out += literals
                position += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[position]
                position += 1
            length += 2
            distance = ((control & 31) << 8) + data[position] + 1
            position += 1
            start = len(out) - distance
            if start < 0:
                raise ValueError("a copy starts before the first byte")
            copied = out[start : start + length]
            if distance < length:
                # The copy overlaps what it writes: the last `distance` bytes repeat.
                copied = (copied * (length // distance + 1))[:length]
            out += copied
            if len(out) > size:
                break
    except IndexError:
        raise ValueError("it ends within an instruction") from None
    if position > end:
        raise ValueError("it ends within a literal")
    if len(out) != size:
        raise ValueError(f"it holds {'more than ' if len(out) > size else ''}{min(len(out), size)} bytes, not {size}")
    return bytes(out)


def compress(data: bytes) -> bytes:
    """An LZF stream that decompresses to `data`. It may be longer than `data`, by one byte in 32."""
    out = bytearray()
    # Segments keep the tables below small. The stream needs no seam between them.
    for start in range(0, len(data), _SEGMENT):
        _compress_segment(data[start : start + _SEGMENT], out)
    return bytes(out)


def _compress_segment(data: bytes, out: bytearray) -> None:
    previous, following = _match_tables(data)
    position, end = 0, len(data)
    while position < end:
        at = following[position]
        for start in range(position, at, _MAX_LITERALS):
            literals = data[start : min(start + _MAX_LITERALS, at)]
            out.append(len(literals) - 1)
            out += literals
        if at == end:
            return
        earlier = previous[at]
        length, longest = 3, min(_MAX_MATCH, end - at)
        while length < longest and data[earlier + length] == data[at + length]:
            length += 1
        distance = at - earlier - 1
        if length - 2 < 7:
            out.append((length - 2) << 5 | distance >> 8)
        else:
            out.append(7 << 5 | distance >> 8)
            out.append(length - 2 - 7)
        out.append(distance & 255)
        position = at + length


def _match_tables(data: bytes) -> tuple[memoryview, memoryview]:
    """For each byte: where it and the next two stood before, or -1; and the next byte (or the end) with such a place.

    Found by sorting all triples at once, so that the loop above runs over matches instead of bytes.
    """
    size = len(data)
    previous = np.full(size + 1, -1, dtype=np.int32)
    if size >= 3:
        values = np.frombuffer(data, dtype=np.uint8).astype(np.uint32)
        triples = values[:-2] | values[1:-1] << 8 | values[2:] << 16
        order = np.argsort(triples, kind="stable").astype(np.int32)
        equal = triples[order[1:]] == triples[order[:-1]]
        near = order[1:] - order[:-1] <= _MAX_DISTANCE
        previous[order[1:][equal & near]] = order[:-1][equal & near]
    following = np.where(previous >= 0, np.arange(size + 1, dtype=np.int32), np.int32(size))
    following = np.minimum.accumulate(following[::-1])[::-1]
    # Indexing a memoryview gives plain integers, several times faster than indexing an array.
    return previous.data, np.ascontiguousarray(following).data
