"""Read YAML strictly: one document, text keys, no duplicates, no tags, no tabs, few aliases.

Scalars are those of YAML 1.2. The composer and constructor of PyYAML are left out: they resolve
scalars by YAML 1.1 and recurse without bound.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from labdrive.model.errors import Problem
from labdrive.recipe.scalars import Scalar, resolve
from labdrive.recipe.source import FieldPath, Place, Source, dotted

MOST_NODES = 20_000
DEEPEST = 40
LARGEST_BYTES = 1_000_000

_NO_TAGS = "tags are not taken: recipes and benches hold plain data"
_WORDS = {
    "mapping values are not allowed": "a ':' is out of place; quote the text or mend the "
    "indentation",
    "could not find expected ':'": "a ':' is missing after a field's name",
    "expected <block end>": "the indentation does not fit the lines above",
    "expected ',' or ']'": "a ',' or ']' is missing",
    "expected ',' or '}'": "a ',' or '}' is missing",
    "found unexpected end of stream": "a quote is not closed",
    "that cannot start any token": "this character cannot begin a value; quote the text",
    "undefined tag handle": _NO_TAGS,
    "expected the node content": "a value is due here",
    "sequence entries are not allowed": "a list cannot begin here; put it on a line of its own",
    "expected '<document start>'": "this does not belong to what is above",
    "unknown escape character": "in double quotes \\ begins an escape; use single quotes",
}


def read(path: Path) -> Source:
    """Read a file; all that is wrong with it is in the source's `problems`."""
    label = str(path)
    try:
        raw = path.read_bytes()
        if len(raw) > LARGEST_BYTES:
            return _failed(label, f"larger than {LARGEST_BYTES} bytes; is it a recipe?")
        return compose(raw.decode("utf-8-sig"), label)
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8-sig")
        return _failed(label, "not UTF-8 text; save the file as UTF-8", before)
    except FileNotFoundError:
        return _failed(label, "there is no such file")
    except (OSError, ValueError) as error:
        return _failed(label, f"cannot be read: {getattr(error, 'strerror', None) or error}")


def compose(text: str, label: str) -> Source:
    """Turn text into data and places; all that is wrong is in the source's `problems`."""
    text = text.replace("\r\n", "\n")
    before, tab, _ = text.partition("\t")
    if tab:
        return _failed(label, "a tab; use spaces", before)
    try:
        builder = _Builder(label, list(yaml.parse(text, Loader=yaml.SafeLoader)))
    except yaml.reader.ReaderError as error:
        message = f"character U+{ord(text[error.position]):04X} cannot be in a YAML file"
        return _failed(label, message, text[: error.position])
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        before = text[: mark.index] if mark else ""
        return _failed(label, _plain_words(str(error.problem)), before)
    builder.build()
    return builder.source


def _failed(label: str, message: str, before: str | None = None) -> Source:
    """Return a source without data, whose problem stands after the text `before`."""
    if before is None:
        return Source(label, problems=[Problem(message, file=label)])
    line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
    return Source(label, problems=[Problem(message, "", label, line, column)])


def _plain_words(problem: str) -> str:
    return next((plain for jargon, plain in _WORDS.items() if jargon in problem), problem)


class _TooMuchError(Exception):
    """The file is too deep or expands too far to go on; the problem is noted."""


class _Builder:
    """Builds a source from the events of PyYAML's parser; an alias reads its anchor's again."""

    def __init__(self, label: str, events: list[yaml.Event]) -> None:
        self.source = Source(label)
        self._events = events
        self._at = 1
        self._begun: dict[str, int] = {}
        self._finished: set[str] = set()
        self._nodes = 0

    def build(self) -> None:
        """Build the only document there should be; an empty file is an empty mapping."""
        self.source.values[()] = Place(self.source.label, 1, 1)
        self.source.data = {}
        with suppress(_TooMuchError):
            if not isinstance(self._next(), yaml.StreamEndEvent):
                self.source.data = self._node(())
                self._next()
                after = self._next()
                if not isinstance(after, yaml.StreamEndEvent):
                    self._refuse("a second document begins; a file holds one", after, ())
            self.source.whole = True

    def _next(self) -> yaml.Event:
        self._at += 1
        return self._events[self._at - 1]

    def _place(self, event: yaml.Event) -> Place:
        mark = event.start_mark
        line, column = (mark.line, mark.column) if mark else (0, 0)
        return Place(self.source.label, line + 1, column + 1)

    def _refuse(
        self, message: str, event: yaml.Event, path: FieldPath, got: str | None = None
    ) -> None:
        at = self._place(event)
        problem = Problem(message, dotted(path), at.label, at.line, at.column, got)
        self.source.problems.append(problem)

    def _node(self, path: FieldPath) -> Any:
        event = self._next()
        self._refuse_too_much(event, path)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, path)
        self.source.values[path] = self._place(event)
        if (tag := getattr(event, "tag", None)) is not None:
            self._refuse(_NO_TAGS, event, path, tag)
        name, start = getattr(event, "anchor", None), self._at - 1
        if name is not None and self._begun.setdefault(name, start) != start:
            self._refuse(f"&{name} already marks another value", event, path)
        value = self._value(event, path)
        self._finished |= {name} if name is not None else set()
        return value

    def _refuse_too_much(self, event: yaml.Event, path: FieldPath) -> None:
        self._nodes += 1
        if self._nodes > MOST_NODES:
            self._refuse(f"more than {MOST_NODES} values once aliases are expanded", event, path)
            raise _TooMuchError
        if len(path) > DEEPEST:
            self._refuse(f"nested more than {DEEPEST} deep", event, ())
            raise _TooMuchError

    def _alias(self, event: yaml.AliasEvent, path: FieldPath) -> Any:
        if event.anchor not in self._finished:
            self.source.values[path] = self._place(event)
            self._refuse(f"no value above is marked &{event.anchor}", event, path)
            return None
        here, self._at = self._at, self._begun[event.anchor]
        value = self._node(path)
        self._at = here
        return value

    def _value(self, event: yaml.Event, path: FieldPath) -> Any:
        if isinstance(event, yaml.MappingStartEvent):
            return self._mapping(path)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(path)
        return self._scalar(event, path) if isinstance(event, yaml.ScalarEvent) else None

    def _sequence(self, path: FieldPath) -> list[Any]:
        items: list[Any] = []
        while not isinstance(self._events[self._at], yaml.SequenceEndEvent):
            items.append(self._node((*path, len(items))))
        self._next()
        return items

    def _mapping(self, path: FieldPath) -> dict[str, Any]:
        fields: dict[str, Any] = {}
        while not isinstance(event := self._events[self._at], yaml.MappingEndEvent):
            key = self._key(event, path)
            if key in fields:
                first = self.source.keys[*path, key].line
                self._refuse(f"given twice, first on line {first}", event, (*path, key))
            self.source.keys[*path, key] = self._place(event)
            fields[key] = self._node((*path, key))
        self._next()
        return fields

    def _key(self, event: yaml.Event, path: FieldPath) -> str:
        """Return a key as text; what is no text is refused, and stands as it was written."""
        key = event.value if isinstance(event, yaml.ScalarEvent) else "?"
        if not isinstance(self._node((*path, key)), str):
            self._refuse("a field's name must be text; put it in quotes", event, path, key)
        return key

    def _scalar(self, event: yaml.ScalarEvent, path: FieldPath) -> Scalar:
        try:
            event.value.encode()
            return resolve(event.value) if event.implicit[0] else event.value
        except UnicodeEncodeError:
            self._refuse("half a surrogate pair is no text", event, path)
        except ValueError as error:
            self._refuse(str(error), event, path, event.value[:40])
        return None
