"""The strict reader: YAML 1.2 scalars, lines of keys, and refusals instead of surprises."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.config.strict_yaml import MAX_DEPTH, parse, resolve
from dlogen.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        ("-1.5e+2", -150.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("21", 21),
        ("+3", 3),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        (".inf", math.inf),
        ("-.INF", -math.inf),
    ],
)
def test_core_schema_scalars(text, value):
    read = resolve(text)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    "text", ["on", "off", "yes", "no", "Y", "n", "1:30", "1_000", "0b1", "nan", "inf", "1,5", "2024-01-01", "=", "１"]
)
def test_everything_else_is_text(text):
    assert resolve(text) == text


def test_not_a_number_is_read_as_such():
    assert math.isnan(resolve(".nan"))


def test_an_integer_of_many_digits_does_not_stop_python():
    assert resolve("9" * 10_000) == math.inf
    assert resolve("0x" + "f" * 10_000) == "0x" + "f" * 10_000


def test_quotes_keep_text():
    document = parse("a: '1e-3'\nb: \"true\"\nc: |\n  12\n")
    assert document.data == {"a": "1e-3", "b": "true", "c": "12\n"}


def test_lines_are_those_of_the_keys():
    document = parse("# comment\nr: 1\n\nnormals:\n  # another\n  radius: 2\n  neighbours:\n    3\n")
    assert document.lines == {("r",): 2, ("normals",): 4, ("normals", "radius"): 6, ("normals", "neighbours"): 7}


def test_duplicates_are_reported_with_both_lines_and_the_first_is_kept():
    document = parse("r: 1\nn:\n  a: 1\n  b: 2\n  a: {x: 3}\nr: [2, 3]\n")
    assert document.data == {"r": 1, "n": {"a": 1, "b": 2}}
    assert document.duplicates == [(("n", "a"), 3, 5), (("r",), 1, 6)]


def test_keys_are_words_whatever_they_look_like():
    assert parse("1: a\nnull: b\ntrue: c\n1.0: d\n").data == {"1": "a", "null": "b", "true": "c", "1.0": "d"}


@pytest.mark.parametrize("text", ["", "\n", "# only a comment\n", "---\n", "---\n...\n"])
def test_nothing_is_none(text):
    assert parse(text).data is None


def test_json_is_yaml():
    assert parse('{"r": 0.02, "normals": {"neighbours": 12}, "list": [1, null, true]}').data == {
        "r": 0.02,
        "normals": {"neighbours": 12},
        "list": [1, None, True],
    }


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("r: 1\n\tx: 2\n", 2, "tab"),
        ("normals:\n\tradius: 2\n", 2, "tab"),
        ("r: 1\nx: [1, 2\n", 3, "not valid YAML"),
        ("r: 1\n x: 2\n", 2, "not valid YAML"),
        ("r: 1\njust words\n", 2, "':' is missing"),
        ("r: 1\njust words\nx: 2\n", 2, "':' is missing"),
        ("a: 'open\n", 2, "not valid YAML"),
        ("a: 1\n---\nb: 2\n", 2, "second document"),
        ("a: &x 1\n", 1, "anchors"),
        ("a: 1\nb: *x\n", 2, "aliases"),
        ("<<: *base\n", 1, "aliases"),
        ("a: !!python/object/apply:os.system ['true']\n", 1, "!!python"),
        ("a: !!str 12\n", 1, "!!str"),
        ("a: ! 12\n", 1, "tags"),
        ("[a, b]: 1\n", 1, "key must be a word"),
        ("? {a: b}\n: 1\n", 1, "key must be a word"),
        ("a: 1\nb: \x00\n", 2, "U+0000"),
        ("a: 1\nb: \x1b[31m\n", 2, "U+001B"),
        ("%YAML 9.1\n---\na: 1\n", 1, "not valid YAML"),
    ],
)
def test_refusals_name_the_line(text, line, says):
    with pytest.raises(ConfigError) as caught:
        parse(text)
    assert caught.value.message.startswith(f"line {line}: ")
    assert says in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize("text", ['a: "\\U00110000"', 'a: "\\UFFFFFFFF"', f"%YAML {'1' * 5000}.1\n---\na: 1"])
def test_numbers_that_pyyaml_trips_over_are_refused(text):
    with pytest.raises(ConfigError, match="not valid YAML"):
        parse(text)


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_depth_is_bounded(opening):
    with pytest.raises(ConfigError, match=f"more than {MAX_DEPTH} levels|not valid YAML"):
        parse(opening * 50_000)


def test_a_bomb_of_aliases_is_refused_at_its_first_anchor():
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    with pytest.raises(ConfigError, match="line 1: anchors"):
        parse(bomb)


@pytest.mark.parametrize("line", ["k{}: 1\n", "- a{}\n", "# comment {}\n", "k{}: [a, b, c]\n"])
def test_the_largest_file_is_read_in_seconds(line):
    text = "".join(line.format(i) for i in range(100_000 // len(line)))
    start = time.perf_counter()
    parse(text[:100_000].rpartition("\n")[0])
    assert time.perf_counter() - start < 20


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    try:
        parse(text)
    except ConfigError as error:
        assert error.hint


@settings(max_examples=300)
@given(st.text(alphabet="ab:-[]{},'\"!&*|>%#?\\ \n\t01.e\x07~<=\ufeff", max_size=40))
def test_any_text_of_indicators_is_read_or_refused(text):
    try:
        parse(text)
    except ConfigError as error:
        assert error.message
