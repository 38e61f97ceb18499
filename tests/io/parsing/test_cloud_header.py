"""Words and claims of headers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_header import (
    CUT_OFF,
    MAX_HEADER,
    bad_line,
    endless,
    refuse_claim,
    refuse_missing,
    refuse_text_claim,
    shorten,
    whole_number,
)


def refusal(call: Callable[[], None]) -> str:
    """The message of the refusal, which comes with a hint."""
    with pytest.raises(InputError) as caught:
        call()
    assert caught.value.hint == CUT_OFF
    return caught.value.message


@pytest.mark.parametrize(
    ("text", "short"),
    [
        ("x y z", "x y z"),
        ("", ""),
        ("Kabelstück", "Kabelstück"),
        ("a\nb\x1b[31mc\x00", "a?b?[31mc?"),
        ("a" * 60, "a" * 60),
        ("a" * 61, "a" * 57 + "..."),
    ],
)
def test_words_of_a_file_in_a_message(text: str, short: str) -> None:
    assert shorten(text) == short


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("+7", 7), ("007", 7), ("9" * 18, 10**18 - 1)])
def test_whole_numbers(text: str, number: int) -> None:
    assert whole_number(text, "WIDTH") == number


@pytest.mark.parametrize("text", ["", "-1", "1.0", "1e3", "1_000", "٣", "9" * 19, "many"])
def test_no_whole_numbers(text: str) -> None:
    with pytest.raises(InputError, match=r"WIDTH is .*, not a whole number") as caught:
        whole_number(text, "WIDTH")
    assert caught.value.hint


def test_what_is_said_of_bad_lines() -> None:
    error = bad_line("PLY", 3, "property\treal x", "unknown type 'real'")
    assert error.message == "PLY header, line 3 ('property?real x'): unknown type 'real'"
    assert error.hint


@pytest.mark.parametrize(("size", "words"), [(MAX_HEADER, "'DATA' in its first 1048576 bytes"), (9, "line 'DATA'")])
def test_what_is_said_of_a_header_without_end(size: int, words: str) -> None:
    error = endless("PCD", "DATA", bytes(size), "not a PCD file")
    assert error.message.endswith(words)
    assert error.hint == "the file is cut off or not a PCD file: copy or export it again"


def test_claims_of_binary_rows() -> None:
    refuse_claim("points", 3, 12, 36)
    refuse_claim("points", 0, 12, -5)
    refuse_claim("'nothing' rows", 10**12, 0, 0)
    assert refusal(lambda: refuse_claim("points", 3, 12, 35)) == "the header claims 3 points, the file holds 2"
    assert refusal(lambda: refuse_claim("points", 3, 12, 35, at_most=True)).endswith("the file has room for 2 at most")
    assert refusal(lambda: refuse_claim("points", 1, 12, -5)) == "the header claims 1 points, the file holds 0"


def test_claims_of_rows_of_text() -> None:
    # "1 2 3\n4 5 6" are 11 bytes.
    refuse_text_claim("points", 2, 3, 11)
    found = refusal(lambda: refuse_text_claim("points", 2, 3, 10))
    assert found == "the header claims 2 points, the file has room for 1 at most"


def test_missing_rows() -> None:
    refuse_missing("points", 3, 3)
    assert refusal(lambda: refuse_missing("points", 3, 2)) == "the header claims 3 points, the file holds 2"
