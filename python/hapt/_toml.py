"""Worlds as the text of a world file, so that the reader of world files checks values from Python too."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def plain(value: Any, key: str) -> Any:
    """`value` as str, bool, int, float, list or dict; NumPy's scalars and arrays become Python's. Raises TypeError for other types."""
    if hasattr(value, "to_table"):
        value = value.to_table()
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (str, bool, int, float)):
        return value
    if isinstance(value, Mapping):
        wrong = next((name for name in value if not isinstance(name, str)), None)
        if wrong is not None:
            raise TypeError(f"{key or 'world'}: keys must be str, not {type(wrong).__name__} ({wrong!r})")
        return {name: plain(inner, f"{key}.{name}" if key else name) for name, inner in value.items() if inner is not None}
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
        return [plain(inner, f"{key}.{index}") for index, inner in enumerate(value)]
    raise TypeError(
        f"{key or 'world'}: a world file has no values of type {type(value).__name__}: "
        'a quantity is a string with a unit, such as "1 ms", or a number in SI'
    )


def inline(value: Any) -> str:
    """A value as TOML on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_name(name)} = {inline(inner)}" for name, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return repr(value)


def document(tables: dict[str, Any]) -> str:
    """The text of a world file: keys first, then a section for each table."""
    sections = [_section("", tables)]
    for name, value in tables.items():
        if isinstance(value, dict) and value and all(isinstance(inner, dict) for inner in value.values()):
            sections += [_section(f"[{_name(name)}.{_name(inner)}]", table) for inner, table in value.items()]
        elif isinstance(value, dict):
            sections.append(_section(f"[{_name(name)}]", value))
        elif _is_tables(value):
            sections += [_section(f"[[{_name(name)}]]", table) for table in value]
    return "\n".join(section for section in sections if section)


def _section(header: str, table: dict[str, Any]) -> str:
    rows = table.items() if header else ((n, v) for n, v in table.items() if not isinstance(v, dict) and not _is_tables(v))
    lines = [header] if header else []
    return "".join(line + "\n" for line in lines + [f"{_name(name)} = {inline(value)}" for name, value in rows])


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(inner, dict) for inner in value)


def _name(name: str) -> str:
    bare = name.isascii() and name.replace("-", "").replace("_", "").isalnum()
    return name if bare else json.dumps(name, ensure_ascii=False)
