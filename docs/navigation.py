"""The list of pages at the side: made once for each folder of pages, and marked for each page.

The theme makes the whole list anew for each page, which would take half of the time of a build.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from bs4 import BeautifulSoup, Tag
from furo.navigation import get_navigation_tree
from sphinx.application import Sphinx

Context = dict[str, Any]

_EARLIER, _LATER = 400, 600  # than the theme, which has 500


class _Pages(NamedTuple):
    """The list for the pages of a folder, and its links by what they lead to."""

    soup: BeautifulSoup
    links: dict[str, Tag]


class Navigation:
    """The lists of all folders."""

    def __init__(self) -> None:
        self._folders: dict[str, _Pages] = {}

    def of(self, page: str, toctree: Callable[..., str]) -> str:
        """The list for a page; `toctree` is what Sphinx offers to the template of this page."""
        folder, _, name = page.rpartition("/")
        if folder not in self._folders:
            self._folders[folder] = _listed(toctree, f"{name}.html")
        pages = self._folders[folder]
        link = pages.links.get(f"{name}.html")
        if link is None:
            return str(pages.soup)
        with _marked(link):
            return str(pages.soup)


def _listed(toctree: Callable[..., str], own: str) -> _Pages:
    """The list of one page, without the marks of this page, whose file is `own`."""
    text = toctree(collapse=False, titles_only=True, maxdepth=-1, includehidden=True)
    soup = BeautifulSoup(get_navigation_tree(text), "html.parser")
    current = soup.find("a", class_="current")
    if current is not None:
        _unmark(current, own)
    return _Pages(soup, {link["href"]: link for link in soup.find_all("a")})


@contextmanager
def _marked(link: Tag) -> Iterator[None]:
    """A link as that of the current page, with all that it stands in."""
    address = link["href"]
    link["class"], link["href"] = ["current", *link["class"]], "#"
    for item in link.find_parents("li"):
        item["class"] = [item["class"][0], "current", *item["class"][1:]]
        if (switch := item.find("input", recursive=False)) is not None:
            switch["checked"] = ""
    link.parent["class"] = [*link.parent["class"], "current-page"]
    for each in link.find_parents("ul"):
        each["class"] = ["current"]
    yield
    _unmark(link, address)


def _unmark(link: Tag, address: str) -> None:
    link["class"], link["href"] = link["class"][1:], address
    for item in link.find_parents("li"):
        item["class"] = [
            word for word in item["class"] if word not in ("current", "current-page")
        ]
        if (switch := item.find("input", recursive=False)) is not None:
            del switch["checked"]
    for each in link.find_parents("ul"):
        del each["class"]


def setup(app: Sphinx) -> dict[str, bool]:
    """Keep Sphinx's list from the theme, and put the marked one in its place."""
    navigation, offered = Navigation(), {}

    def withhold(
        _: Sphinx, page: str, template: str, context: Context, doctree: Any
    ) -> None:
        offered[page] = context.pop("toctree")

    def fill(_: Sphinx, page: str, template: str, context: Context, doctree: Any) -> None:
        context["toctree"] = offered.pop(page)
        context["furo_navigation_tree"] = navigation.of(page, context["toctree"])

    app.connect("html-page-context", withhold, _EARLIER)
    app.connect("html-page-context", fill, _LATER)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
