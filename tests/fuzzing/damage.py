"""Damage to files: to their bytes, and to what is written in them.

`damaged` draws damaged files of any kind: bytes flipped, cut, put in, doubled and swapped; and, of
the kinds of files that have a structure, the structure read, one or two things in it changed, and
written again. What is written again is whole, so that it gets past checksums and parsers.
"""

from __future__ import annotations

import gzip
import io
import json
import lzma
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import PurePath
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yaml
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

Draw = Callable[[st.SearchStrategy[Any]], Any]

RAW = {
    "§digits§": "9" * 5000,
    "§levels§": "[" * 300 + "]" * 300,
    "§nested§": "[" * 20_000,
    "§open§": '{"a":' * 20_000,
}
"""What no library writes, by what stands for it until a document is written."""
WORDS = (
    "", "0", "-1", "1e400", "-1e400", "nan", "inf", "1e17", "1e-320", "9" * 400, "0x10", "1_0", "٣",
    "true", "null", "x", "..", "/", "\0", "§", "\udcff", "1e12", "18446744073709551616", "-0", "#",
    "9" * 5000,
)  # fmt: skip
"""Words that stand where others did."""
VALUES: tuple[Any, ...] = (
    None, True, False, "", "x", "nan", "\0", 0, -1, 1, 7, 255, 2**31, 2**63, 2**64, -(2**63),
    10**400, 0.5, -0.0, 5e-324, 1e17, 1e300, -1e300, 1.8e308, float("nan"), float("inf"),
    float("-inf"),
    [], {}, [[]], [0], [None], {"": 0}, *RAW,
)  # fmt: skip
"""Values that stand where others did."""


@st.composite
def damaged(draw: Draw, name: str, content: bytes) -> bytes:
    """A file of a name, damaged; at times it is left as it is."""
    path = PurePath(name)
    if path.suffix in _PACKED and draw(st.booleans()):
        pack, unpack = _PACKED[path.suffix]
        return pack(draw(damaged(path.stem, unpack(content))))
    rewrite = _REWRITERS.get(path.suffix)
    if rewrite is None or draw(st.integers(0, 2)) == 0:
        return damage_bytes(draw, content)
    for _ in range(draw(st.integers(1, 2))):
        content = rewrite(draw, content)
    return content


def damage_bytes(draw: Draw, content: bytes) -> bytes:
    """Bytes flipped, cut off, put in, doubled, left out or swapped."""
    for _ in range(draw(st.integers(0, 3))):
        first, last = sorted(draw(st.tuples(*[st.integers(0, len(content))] * 2)))
        last = min(last, first + draw(st.sampled_from((1, 4, 64, 4096, 1 << 30))))
        before, part, after = content[:first], content[first:last], content[last:]
        match draw(st.integers(0, 6)):
            case 0:
                content = before
            case 1:
                content = before + after
            case 2:
                content = before + part + part + after
            case 3:
                content = before + draw(st.binary(max_size=8)) + part + after
            case 4:
                content = before + bytes(len(part)) + after
            case 5:
                content = after + part + before
            case 6:
                flipped = bytes(byte ^ draw(st.integers(1, 255)) for byte in part[:2])
                content = before + flipped + part[2:] + after
    return content


def damage_tree(draw: Draw, tree: Any) -> Any:
    """A document, as JSON and YAML hold, with one value, key or item of it another."""
    places = list(_places(tree, ()))
    path = draw(st.sampled_from(places))
    if not path:
        return draw(_values())
    copy = json.loads(json.dumps(tree))
    holder = copy
    for step in path[:-1]:
        holder = holder[step]
    last = path[-1]
    match draw(st.integers(0, 6)):
        case 0:
            del holder[last]
        case 1 if isinstance(holder, list):
            holder.insert(last, draw(st.one_of(_values(), st.just(holder[last]))))
        case 1:
            holder[draw(st.sampled_from((*WORDS, *map(str, range(3)))))] = holder[last]
        case 2 if isinstance(holder, dict):
            holder[draw(st.sampled_from(WORDS))] = holder.pop(last)
        case 2 | 3:
            other = copy
            for step in draw(st.sampled_from(places)):
                other = other[step] if not isinstance(other, str) else other
            holder[last] = json.loads(json.dumps(other))
        case _:
            holder[last] = draw(_values())
    return copy


def _values() -> st.SearchStrategy[Any]:
    numbers = st.one_of(st.floats(), st.integers(-5, 300), st.integers())
    return st.one_of(st.sampled_from(VALUES), numbers, st.text(max_size=4))


def _places(tree: Any, path: tuple[Any, ...]) -> Any:
    """The paths to all values; of long lists of numbers to a few."""
    yield path
    if isinstance(tree, dict):
        for key in tree:
            yield from _places(tree[key], (*path, key))
    elif isinstance(tree, list):
        for k in {*range(min(4, len(tree))), *range(max(0, len(tree) - 2), len(tree))}:
            yield from _places(tree[k], (*path, k))


def _written(text: str) -> bytes:
    for name, raw in RAW.items():
        for quoted in (json.dumps(name), f"'{name}'", name):
            text = text.replace(quoted, raw)
    return text.encode("utf-8", "surrogatepass")


def _rewrite_json(draw: Draw, content: bytes) -> bytes:
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return damage_bytes(draw, content)
    return _written(json.dumps(damage_tree(draw, tree)))


def _rewrite_yaml(draw: Draw, content: bytes) -> bytes:
    try:
        tree = json.loads(json.dumps(yaml.safe_load(content)))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        return damage_bytes(draw, content)
    document = damage_tree(draw, tree)
    if draw(st.booleans()):
        return _written(json.dumps(document, ensure_ascii=False))
    return _written(yaml.safe_dump(document, allow_unicode=True, sort_keys=False, width=200))


def _rewrite_words(draw: Draw, content: bytes) -> bytes:
    """Text, one word of it another, or lines left out, doubled and swapped."""
    text = content.decode("utf-8", "replace")
    if draw(st.booleans()):
        parts = re.split(r"([\s,:?&=<>\"'/\[\](){}]+)", text)
        k = 2 * draw(st.integers(0, (len(parts) - 1) // 2))
        parts[k] = draw(st.one_of(st.sampled_from(WORDS), st.text(max_size=3)))
        return "".join(parts).encode("utf-8", "surrogatepass")
    lines = text.split("\n")
    one, other = draw(st.tuples(*[st.integers(0, len(lines) - 1)] * 2))
    match draw(st.integers(0, 3)):
        case 0:
            del lines[one]
        case 1:
            lines.insert(other, lines[one])
        case 2:
            lines[one], lines[other] = lines[other], lines[one]
        case 3:
            lines[one] = lines[one][: draw(st.integers(0, len(lines[one])))]
    return "\n".join(lines).encode()


def _rewrite_xml(draw: Draw, content: bytes) -> bytes:
    """XML, one element of it another."""
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError):
        return damage_bytes(draw, content)
    elements = list(root.iter())
    element, other = draw(st.tuples(*[st.sampled_from(elements)] * 2))
    word = draw(st.sampled_from([word for word in WORDS if word.isprintable()]))
    match draw(st.integers(0, 5)):
        case 0 if element.attrib:
            element.set(draw(st.sampled_from(sorted(element.attrib))), word)
        case 1:
            element.text = word
        case 2:
            element.clear()
        case 3:
            element.append(ElementTree.fromstring(ElementTree.tostring(other)))
        case 4:
            element[:] = ElementTree.fromstring(ElementTree.tostring(other))[:]
        case _:
            element.tag = other.tag
    return ElementTree.tostring(root)


def damage_array(draw: Draw, array: np.ndarray) -> np.ndarray:
    """An array of another shape or kind, or with other numbers in it."""
    match draw(st.integers(0, 7)):
        case 0:
            return array[: draw(st.integers(0, len(array)))] if array.ndim else array[None]
        case 1:
            return np.concatenate((array, array)) if array.ndim else np.stack((array, array))
        case 2:
            return array[..., None] if draw(st.booleans()) else array.reshape(-1)
        case 3:
            kinds = (np.float64, np.float32, np.int64, np.int32, np.int8, np.bool_, np.uint64)
            with np.errstate(all="ignore"):
                return array.astype(draw(st.sampled_from(kinds)))
        case _ if not array.size:
            return np.zeros(draw(st.sampled_from(((1,), (1, 3), (2, 4), (3,)))), array.dtype)
    copy = array.copy()
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, array.size - 1))
        copy.flat[place] = _number(draw, array.dtype)
    return copy


def _number(draw: Draw, kind: np.dtype[Any]) -> Any:
    if kind.kind == "f":
        extremes = [value for value in VALUES if type(value) is float]
        drawn = draw(st.one_of(st.sampled_from(extremes), st.integers(-3, 300), st.floats()))
        with np.errstate(all="ignore"):
            return np.float64(drawn).astype(kind)
    if kind.kind == "b":
        return draw(st.booleans())
    least, most = np.iinfo(kind).min, np.iinfo(kind).max
    ends = st.sampled_from((least, most, most // 2))
    return draw(
        st.one_of(st.integers(max(least, -3), 100), ends, st.integers(int(least), int(most)))
    )


def _rewrite_archive(draw: Draw, content: bytes) -> bytes:
    """A zip of arrays and JSON, one member of it another."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # noqa: BLE001 - whatever a library says of damage
        return damage_bytes(draw, content)
    name = draw(st.sampled_from(sorted(members)))
    match draw(st.integers(0, 9)):
        case 0:
            del members[name]
        case 1:
            members[draw(st.sampled_from(("more.npy", "a/b", "x.npy", "evil.pkl")))] = members[name]
        case 2:
            members[name] = damage_bytes(draw, members[name])
        case _ if name.endswith(".json"):
            members[name] = _rewrite_json(draw, members[name])
        case _:
            try:
                array = np.load(io.BytesIO(members[name]), allow_pickle=False)
            except Exception:  # noqa: BLE001 - whatever a library says of damage
                return content
            stream = io.BytesIO()
            np.save(stream, damage_array(draw, array), allow_pickle=False)
            members[name] = stream.getvalue()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for member, data in members.items():
            archive.writestr(member, data)
    return packed.getvalue()


def _rewrite_messages(draw: Draw, content: bytes) -> bytes:
    """An MCAP file, one message of it another."""
    messages = messages_of(content)
    if not messages:
        return damage_bytes(draw, content)
    ours = [k for k, (topic, _) in enumerate(messages) if topic in _PLAYED]
    k, other = draw(st.tuples(*[st.sampled_from(ours or range(len(messages)))] * 2))
    topic, data = messages[k]
    match draw(st.integers(0, 9)):
        case 0:
            del messages[k]
        case 1:
            messages.insert(other, messages[k])
        case 2:
            messages[k] = (messages[other][0], data)
        case 3:
            messages[k] = (topic, damage_bytes(draw, data))
        case _:
            messages[k] = (topic, _rewrite_json(draw, data))
    return written_messages(messages)


_PLAYED = ("/albot/header", "/albot/step", "/albot/map", "/albot/things", "/scan")
"""The topics that are read back."""


def messages_of(content: bytes) -> list[tuple[str, bytes]]:
    """Topics and contents of an MCAP file's messages; none where it is damaged."""
    try:
        reader = NonSeekingReader(io.BytesIO(content))
        return [(channel.topic, bytes(m.data)) for _, channel, m in reader.iter_messages()]
    except Exception:  # noqa: BLE001 - whatever a library says of damage
        return []


def written_messages(messages: list[tuple[str, bytes]]) -> bytes:
    """An MCAP file of these messages."""
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    schema = writer.register_schema("any", "jsonschema", b"{}")
    channels: dict[str, int] = {}
    for topic, data in messages:
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, "json", schema)
        writer.add_message(channels[topic], 0, data, 0)
    writer.finish()
    return stream.getvalue()


def _rewrite_png(draw: Draw, content: bytes) -> bytes:
    """A PNG, one chunk of it another, its checksum right."""
    chunks, at = [], 8
    while at + 8 <= len(content):
        (length,) = struct.unpack(">I", content[at : at + 4])
        chunks.append([content[at + 4 : at + 8], content[at + 8 : at + 8 + length]])
        at += 12 + length
    if not chunks:
        return damage_bytes(draw, content)
    chunk = draw(st.sampled_from(chunks))
    chunk[1] = damage_bytes(draw, chunk[1])
    if chunk[0] == b"IHDR" and draw(st.booleans()):
        sides = st.sampled_from((0, 1, 9, 4097, 20_000, 2**31 - 1))
        chunk[1] = struct.pack(">II", draw(sides), draw(sides)) + chunk[1][8:13]
    parts = [
        struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks
    ]
    return content[:8] + b"".join(parts)


_PACKED: dict[str, tuple[Callable[[bytes], bytes], Callable[[bytes], bytes]]] = {
    ".gz": (lambda content: gzip.compress(content, mtime=0), gzip.decompress),
    ".xz": (lzma.compress, lzma.decompress),
}
_REWRITERS: dict[str, Callable[[Draw, bytes], bytes]] = {
    ".json": _rewrite_json,
    ".yaml": _rewrite_yaml,
    ".yml": _rewrite_yaml,
    ".xml": _rewrite_xml,
    ".albot": _rewrite_archive,
    ".checkpoint": _rewrite_archive,
    ".npz": _rewrite_archive,
    ".mcap": _rewrite_messages,
    ".png": _rewrite_png,
    **dict.fromkeys(
        (".log", ".tum", ".relations", ".dat", ".csv", ".world", ".txt", ".pgm"), _rewrite_words
    ),
}
"""How files are written anew, by the ends of their names."""
