"""XML in, as a plain tree with line numbers; documents that could expand are refused unread."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from urmpipe_models.errors import Finding, RobotError
from urmpipe_models.files.contents import read_contents

LONGEST = 10_000
"""Letters of an attribute at most."""


@dataclass(slots=True)
class Node:
    """One element.

    Attributes:
        tag: Its name as written, prefix included.
        attributes: Its attributes.
        line: Where it starts in the file, from 1.
        children: The elements in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Node] = field(default_factory=list)

    def all(self, tag: str) -> list[Node]:
        """Return the children of that name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Node | None:
        """Return the first child of that name, or None."""
        return next(iter(self.all(tag)), None)

    def walk(self) -> Iterator[Node]:
        """Yield this element and all below it, in the order of the file."""
        waiting = [self]
        while waiting:
            node = waiting.pop()
            yield node
            waiting.extend(reversed(node.children))


def read_xml(path: Path) -> Node:
    """Return the root element of an XML file.

    Entities can be declared only in a document type, so a document with one is refused at its first
    character: nothing is ever expanded or fetched.

    Raises:
        RobotError: If the file cannot be read, is not well-formed, or has a document type or an attribute of
            more than `LONGEST` letters.
    """
    return _parsed(read_contents(path, RobotError, (".urdf",)), path)


def _parsed(content: bytes, path: Path) -> Node:
    """Return the root element of a document, whose path is for the errors."""
    parser = expat.ParserCreate()
    document = Node("", {}, 0)
    ancestors = [document]

    def start(tag: str, attributes: dict[str, str]) -> None:
        """Hang a new node below the open one."""
        if (longest := max(map(len, attributes.values()), default=0)) > LONGEST:
            message = f"found an attribute of {longest} letters, allowed: {LONGEST} at most"
            raise RobotError(Finding(message, str(path), line=parser.CurrentLineNumber))
        node = Node(tag, attributes, parser.CurrentLineNumber)
        ancestors[-1].children.append(node)
        ancestors.append(node)

    def end(_: str) -> None:
        """Close the open node."""
        ancestors.pop()

    def doctype(*_: object) -> None:
        """Refuse what could define entities."""
        message = "found a document type (<!DOCTYPE ...>); allowed: XML without document type and entities"
        raise RobotError(Finding(message, str(path), line=parser.CurrentLineNumber))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise RobotError(Finding(f"not well-formed XML: {reason}", str(path), line=error.lineno)) from error
    except (LookupError, ValueError) as error:  # an encoding that expat does not know, or cannot use
        raise RobotError(Finding(f"cannot be decoded: {error}; allowed: UTF-8", str(path))) from error
    return document.children[0]
