"""The JSON Schema of `albot-world` files, and what breaking it means in words."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, cast

import jsonschema
from jsonschema.exceptions import ValidationError, best_match

from albot_core.errors import InputError
from albot_maps.formats.yaml_document import YamlDocument, shown


def check_schema(document: YamlDocument, source: str) -> None:
    """Check that a document has the form of an `albot-world` file.

    Raises:
        InputError: It has not; with the line.
    """
    data = document.data
    if not isinstance(data, dict):
        found = "nothing" if data is None else shown(data)
        raise InputError(source, "a YAML mapping with the key albot-world", found, place="line 1")
    if "albot-world" not in data:
        found = ", ".join(data) or "none"
        raise InputError(source, "the key albot-world", f"the keys {found}", place="line 1")
    error = best_match(_validator().iter_errors(data), key=_rank)
    if error is not None:
        path, expected, found = _explained(error)
        raise InputError(source, expected, found, place=document.place(path))


@cache
def _validator() -> jsonschema.Draft202012Validator:
    file = resources.files("albot_maps.formats") / "albot-world.schema.json"
    return jsonschema.Draft202012Validator(json.loads(file.read_text(encoding="utf-8")))


def _rank(error: ValidationError) -> tuple[int, bool]:
    """For best_match: the shallowest first, and there an unknown key before the rest."""
    return -len(error.absolute_path), error.validator == "additionalProperties"


def _explained(error: ValidationError) -> tuple[list[str | int], str, str]:
    """Path, what was expected there and what was found instead."""
    path = list(error.absolute_path)
    schema = cast("Mapping[str, Any]", error.schema)
    keys: dict[str, Any] = error.instance if isinstance(error.instance, dict) else {}
    if error.validator == "additionalProperties":
        known = list(schema["properties"])
        unknown = next(key for key in keys if key not in known)
        close = difflib.get_close_matches(unknown, known, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        return [*path, unknown], f"one of the keys {', '.join(known)}", f"{unknown}{hint}"
    if error.validator == "required":
        missing = next(key for key in schema["required"] if key not in keys)
        return path, f"the key {missing}", f"only {', '.join(keys) or 'an empty mapping'}"
    return path, schema["description"], shown(error.instance)
