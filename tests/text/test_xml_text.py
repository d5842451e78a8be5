"""XML of strangers is read within bounds, of bytes and of text alike."""

from __future__ import annotations

import pytest

from aerodaas.text.xml_text import XmlError, parse_xml


@pytest.mark.parametrize(
    ("content", "problem", "line"),
    [
        ("", "is no XML", 1),
        ("<a>\n<b></a>", "is no XML", 2),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "declares no entities", None),
        ("<a>\0</a>", "or is no UTF-8", None),
        ("<a>" * 41 + "</a>" * 41, "more than 40 levels deep", None),
        (f"<a>{'<b/>' * 41}</a>", "more than 41 elements", None),
    ],
)
@pytest.mark.parametrize("encoded", [False, True])
def test_what_is_refused(content: str, problem: str, line: int | None, *, encoded: bool) -> None:
    """With the line of what is no XML."""
    with pytest.raises(XmlError, match=problem) as caught:
        parse_xml(content.encode() if encoded else content, "a map", 41)
    assert caught.value.line == line


@pytest.mark.parametrize("content", ["<a>" * 40 + "</a>" * 40, f"<a>{'<b/>' * 39}</a>"])
def test_what_just_fits_is_read(content: str) -> None:
    """Forty levels, and as many elements as may be."""
    assert parse_xml(content, "a map", 40).tag == "a"


def test_bytes_are_read_as_they_declare() -> None:
    """A text has been decoded, so that its declaration is of no use."""
    declared = '<?xml version="1.0" encoding="ISO-8859-1"?><a>\xe4</a>'
    assert parse_xml(declared.encode("latin-1"), "a map").text == "\xe4"
    assert parse_xml(declared, "a map").text == "\xe4"
    for encoding in ("utf-7", "klingon"):
        declaration = f'<?xml version="1.0" encoding="{encoding}"?><a/>'.encode()
        with pytest.raises(XmlError, match="use UTF-8"):
            parse_xml(declaration, "a map")
