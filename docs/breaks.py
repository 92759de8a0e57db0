"""Long names may be continued on the next line: after a point, an underscore or a bracket, and before a capital.

Without such a place browsers break a name at any letter where it is wider than the screen.
"""

import re

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_ALONE, _IN_TEXT = 16, 30  # characters; a shorter name fits on a telephone
_PLACE = re.compile(r"(?<=[._/(=])(?=\w)|(?<=[a-z])(?=[A-Z])")


class Translator(HTML5Translator):
    """Sphinx's translator, which offers breaks in long names."""

    def visit_Text(self, node: nodes.Text) -> None:  # noqa: N802  the name is docutils's
        """Write a text."""
        first = len(self.body)
        super().visit_Text(node)
        alone = isinstance(node.parent, nodes.title | nodes.reference | nodes.inline)
        long = re.compile(rf"[^\s<>]{{{_ALONE if alone else _IN_TEXT},}}")
        self.body[first:] = [
            long.sub(lambda name: _PLACE.sub("<wbr>", name[0]), part)
            for part in self.body[first:]
        ]


def setup(app: Sphinx) -> dict[str, bool]:
    """Write pages with breaks."""
    app.set_translator("html", Translator)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
