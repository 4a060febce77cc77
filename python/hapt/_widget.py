"""The page of a world in a notebook, without a server."""

from __future__ import annotations

import html


class Widget:
    """A world that runs in a frame under a notebook's cell: the page of `hapt live` with hapt's core as WebAssembly.

    `html` is the page as one document, which can also be saved as a file. It loads nothing else.
    """

    def __init__(self, page: str, title: str, height: int = 720) -> None:
        self.html = page
        self._title = title
        self._height = height

    def __repr__(self) -> str:
        return f"<hapt.Widget of {self._title}>"

    def _repr_html_(self) -> str:
        # The sandbox gives the frame its own origin: its scripts cannot access the notebook.
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" title="{html.escape(self._title)}, running" width="100%" height="{self._height}"'
            ' sandbox="allow-scripts allow-downloads" allow="clipboard-write" style="border:0"></iframe>'
        )
