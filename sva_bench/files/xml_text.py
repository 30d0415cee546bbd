"""Reading of XML files: elements with their lines, and nothing that could reach beyond the file or outgrow it.

Document types are refused, and entities with them: no file of ours needs them, and they name other files and multiply.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from sva_bench.errors import BadFile

MAX_DEPTH = 64
MAX_ELEMENTS = 50_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Element:
    """An element of an XML file, without its text.

    Attributes:
        tag: Its name, with a prefix if it has one.
        line: Its line, counted from 1.
        attributes: Its attributes by name.
        children: The elements within it, in order.
    """

    tag: str
    line: int
    attributes: Mapping[str, str]
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> list[Element]:
        """The elements of that name directly within it."""
        return [child for child in self.children if child.tag == tag]


def parse_xml(content: bytes, path: Path | str) -> Element:
    """The root element of an XML file.

    Args:
        content: The bytes of the file, of a size that was checked.
        path: The file, for messages.

    Raises:
        BadFile: If it is not well-formed, has a document type, or is nested too deep or too long.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    root: list[Element] = []
    inside: list[Element] = []
    count = 0

    def refuse_document_type(*_: object) -> None:
        raise BadFile(path, parser.CurrentLineNumber, "", "it has a document type (<!DOCTYPE ...>), with which a file "
                      "may name others and multiply itself; take it away")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MAX_ELEMENTS or len(inside) >= MAX_DEPTH:
            what = f"more than {MAX_ELEMENTS} elements" if count > MAX_ELEMENTS else f"more than {MAX_DEPTH} levels"
            raise BadFile(path, parser.CurrentLineNumber, "", f"it has {what}")
        element = Element(tag=tag, line=parser.CurrentLineNumber, attributes=attributes)
        (inside[-1].children if inside else root).append(element)
        inside.append(element)

    def end(_: str) -> None:
        inside.pop()

    parser.StartDoctypeDeclHandler = refuse_document_type
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise BadFile(path, error.lineno, "", f"not well-formed XML: {expat.ErrorString(error.code)} (column "
                      f"{error.offset + 1})") from None
    except (LookupError, ValueError):  # an encoding that Python doesn't know, or has no table for
        raise BadFile(path, 1, "", "XML in an unknown encoding; save it as UTF-8") from None
    return root[0]
