from __future__ import annotations

import html
import xml.etree.ElementTree as ElementTree

import pytest

from dlogen.io.xml_text import element


@pytest.mark.parametrize(
    "text", ["", "segment_01", "a & b", "<\"'>", "Kabel Ø 3", "管 𝄞", "tab\tand\nline", "\u00a0\u2028"]
)
def test_texts_read_back(text: str) -> None:
    made = element("link", name=text)
    assert made == f'<link name="{html.escape(text)}"/>'
    # Parsers turn white space in attributes into blanks.
    assert ElementTree.fromstring(made).get("name") == text.replace("\t", " ").replace("\n", " ")


@pytest.mark.parametrize("character", ["\x00", "\x1b", "\ud800", "\udfff", "\ufffe", "\uffff"])
def test_what_xml_cannot_hold_is_replaced(character: str) -> None:
    assert element("link", name=f"a{character}<b") == '<link name="a\ufffd&lt;b"/>'
