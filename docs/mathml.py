"""Formulas of the pages as MathML, which browsers draw themselves: no script, no font and no picture is loaded.

docutils converts. A formula that it does not know is a warning, which the build takes as an error.
"""

import re

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

_LOG = logging.getLogger(__name__)
_PRIMES = re.compile("'+")
_BAR = re.compile(r"<mo([^>]*)>\|</mo>")


def setup(app: Sphinx) -> dict[str, bool]:
    """Make MathML what formulas become in HTML."""
    app.add_html_math_renderer(
        "mathml", inline_renderers=(_inline, None), block_renderers=(_block, None)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def mathml(tex: str, *, as_block: bool = False) -> str:
    """A formula as a `math` element; MathError for a command that is not known.

    Primes would be apostrophes, and bars would stand apart from what they enclose, as signs of a condition do.
    """
    primed = _PRIMES.sub(lambda primes: "^{" + r"\prime" * len(primes[0]) + "}", tex)
    converted = str(tex2mathml(primed, as_block=as_block))
    return _BAR.sub(r'<mo\1 lspace="0" rspace="0">|</mo>', converted)


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(_converted(node, as_block=False))
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    opening = translator.starttag(
        node, "div", CLASS="math-block", tabindex="0"
    )  # it can be scrolled by keys
    translator.body.append(f"{opening}{_converted(node, as_block=True)}</div>\n")
    raise nodes.SkipNode


def _converted(node: nodes.Element, *, as_block: bool) -> str:
    try:
        return mathml(node.astext(), as_block=as_block)
    except MathError as error:
        _LOG.warning("formula: %s", error, location=node)
        return f"<code>{nodes.unescape(node.astext())}</code>"
