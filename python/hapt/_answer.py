"""The JSON of a command as a mapping."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import Any


class Answer(Mapping[str, Any]):
    """A mapping with the fields of the command's `--json`."""

    def __init__(self, fields: dict[str, Any]) -> None:
        self._fields = fields

    def __getitem__(self, name: str) -> Any:
        return self._fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __repr__(self) -> str:
        return f"<hapt.{type(self).__name__} {self._fields}>"


class Certificate(Answer):
    """The result of `hapt check`: true where everything is certified; `print` shows the text of `hapt check`."""

    def __init__(self, fields: dict[str, Any], text: str) -> None:
        super().__init__(fields)
        self._text = text

    def __bool__(self) -> bool:
        return bool(self._fields["certified"])

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"<hapt.{type(self).__name__} certified={bool(self)}>"

    def _repr_html_(self) -> str:
        # The notebook's own style for `pre` breaks lines and has no font of fixed width.
        style = "margin:0.3em 0;font-family:monospace;white-space:pre;overflow-x:auto;line-height:1.35"
        colour, word = ("#1a7f37", "certified") if self else ("#b42318", "not certified")
        return (
            f'<div><strong style="color:{colour}">{word}</strong>'
            f'<pre style="{style}">{html.escape(self._text)}</pre></div>'
        )
