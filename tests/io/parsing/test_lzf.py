"""LZF against python-neo-lzf, and against damage."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.io.parsing.lzf import MAX_RATIO, compress, decompress

# Few letters and repeats make matches, of all lengths and distances.
_data = st.one_of(
    st.binary(max_size=300),
    st.builds(lambda part, times: part * times, st.binary(min_size=1, max_size=12), st.integers(1, 900)),
    st.lists(st.sampled_from([b"abc", b"abd", b"a", b"zzzzzzzz", bytes(300)]), max_size=60).map(b"".join),
)


@settings(deadline=None)
@given(_data)
def test_round_trip(data):
    assert decompress(compress(data), len(data)) == data


@settings(deadline=None)
@given(_data)
def test_the_other_implementation_agrees(data):
    lzf = pytest.importorskip("lzf")
    if data:
        assert lzf.decompress(compress(data), len(data)) == data
    packed = lzf.compress(data) if len(data) > 4 else None
    if packed is not None:  # it gives up where nothing is gained
        assert decompress(packed, len(data)) == data


@pytest.mark.parametrize("size", [8190, 8191, 8192, 8193, (1 << 20) - 1, 1 << 20, (1 << 20) + 5])
def test_edges_of_the_window_and_of_the_segments(size):
    pattern = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8).tobytes()
    data = pattern + pattern[:4000]
    assert decompress(compress(data), len(data)) == data


def test_the_densest_stream():
    data = bytes(264 * 1000)
    ratio = len(data) / len(compress(data))
    assert 0.99 * MAX_RATIO < ratio <= MAX_RATIO


def test_bytes_by_hand():
    # Three literals, a copy of 9 from 3 back that overlaps itself, a copy of 4 from 12 back.
    assert decompress(b"\x02abc" + b"\xe0\x00\x02" + b"\x40\x0b", 16) == b"abcabcabcabcabca"


@pytest.mark.parametrize(
    ("stream", "size", "message"),
    [
        (b"\x02ab", 3, "within a literal"),
        (b"\x00a\x20", 4, "within an instruction"),
        (b"\x00a\xe0", 4, "within an instruction"),
        (b"\x00a\x20\x01", 4, "before the first byte"),
        (b"\x02abc", 4, "holds 3 bytes, not 4"),
        (b"\x02abc", 2, "holds more than 2 bytes"),
        (b"", 1, "holds 0 bytes, not 1"),
    ],
)
def test_damage_is_refused(stream, size, message):
    with pytest.raises(ValueError, match=message):
        decompress(stream, size)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200), st.integers(0, 400))
def test_any_bytes_give_the_size_or_an_error(stream, size):
    with contextlib.suppress(ValueError):
        assert len(decompress(stream, size)) == size
