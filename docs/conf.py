"""The documentation site: ``make site`` builds it into build/site, without a network.

The pages are Markdown that reads well in the repository, too. Two things are made here: a link
from a page to a source file leads to a page that shows the file, and the directives
``public-names`` and ``room`` list what is in the packages, with its docstrings.
"""

from __future__ import annotations

import html
import pkgutil
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import swarmctl  # noqa: E402  (this checkout's)

project = "swarmctl"
author = copyright = "The swarmctl authors"
version = release = swarmctl.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"swarmctl {swarmctl.__version__}"
html_copy_source = False
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_type_aliases = {name: name for name in ("Array", "Mask", "ArrayLike", "Vector")}
add_module_names = False
napoleon_numpy_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]
suppress_warnings = ["ref.python"]  # two classes of one name
toc_object_entries = False  # two thousand of them


TOP = {"index": "README.md", "contributing": "CONTRIBUTING.md", "changelog": "CHANGELOG.md"}
"""Pages that stand at the top of the repository, by their names on the site."""


class LinksToSources(SphinxTransform):
    """Turns links to files outside docs/ into links to the pages that ``source_pages`` makes."""

    default_priority = 1  # before Sphinx takes them for downloads

    def apply(self, **_: object) -> None:
        """Runs once for each page."""
        here = self.env.docname
        shown = self.env.metadata[here].setdefault("sources", [])
        links = [
            *self.document.findall(addnodes.download_reference),
            *self.document.findall(addnodes.pending_xref),
        ]
        for link in links:
            target = (Path(self.env.doc2path(here)).parent / link["reftarget"]).resolve()
            if link.get("refdomain") or not target.exists() or target.suffix == ".png":
                continue
            source = target.relative_to(ROOT).as_posix()
            shown.append(source)
            uri = self.app.builder.get_relative_uri(here, f"source/{source}")
            link.replace_self(nodes.reference("", "", *link.children, refuri=uri, internal=True))


def source_pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """The pages that show the source files which other pages link to."""
    assert app.env is not None
    shown = {source for data in app.env.metadata.values() for source in data.get("sources", [])}
    for source in sorted(shown):
        path = ROOT / source
        if path.is_dir():
            names = "\n".join(sorted(f"{source}/{child.name}" for child in path.iterdir()))
            body = f"<pre>{html.escape(names)}</pre>"
        else:
            try:
                lexer = get_lexer_for_filename(source)
            except ClassNotFound:
                lexer = TextLexer()
            body = highlight(path.read_text(), lexer, HtmlFormatter())
        yield f"source/{source}", {"title": source, "body": f"<h1>{source}</h1>{body}"}, "page.html"


class Room(SphinxDirective):
    """Lists a package: each of its modules, with the docstrings of what is public in it."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Writes an ``automodule`` for each module."""
        package = import_module(self.arguments[0])
        folders = getattr(package, "__path__", [])  # a module by itself has none
        inside = pkgutil.walk_packages(folders, f"{package.__name__}.")
        names = [package.__name__, *(module.name for module in inside)]
        lines: list[str] = []
        for name in names:
            lines += [name, "-" * len(name), "", f".. automodule:: {name}", ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


class PublicNames(SphinxDirective):
    """Lists the public names of swarmctl; each leads to its docstring."""

    def run(self) -> list[nodes.Node]:
        """Writes a list of links."""
        lines: list[str] = []
        for name in swarmctl.__all__:
            value = getattr(swarmctl, name)
            home = getattr(value, "__module__", "")
            is_ours = home.startswith("swarmctl") and hasattr(value, "__qualname__")
            target = f"{home}.{value.__qualname__}" if is_ours else ""  # constants have no page
            lines.append(f"* :py:obj:`{name} <{target}>`" if target else f"* ``{name}``")
        return self.parse_text_to_nodes("\n".join(lines))


def plain_text(
    _app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Lets the mathematics of a docstring stand as it is written.

    An indented block after an empty line is an equation or a drawing, and is shown literally.
    Elsewhere, what would be markup (``|``, ``*``, a trailing ``_``) is text unless it is quoted.
    """
    shown: list[str] = []
    literal = False
    indent = 0
    for line in lines:
        inner = len(line) - len(line.lstrip())
        if line.strip():
            if shown and not shown[-1].strip() and inner > indent and not literal:
                literal = True
                shown += [" " * indent + "::", ""]
            if inner <= indent:
                literal = False
            if not literal:
                indent = inner
        shown.append(line if literal or line.lstrip().startswith("..") else _escaped(line))
    lines[:] = shown


def _escaped(line: str) -> str:
    bullet = re.match(r"\s*\* |", line)
    assert bullet is not None
    parts = re.split(r"(``.*?``|:\w+:`.*?`)", line[bullet.end() :])
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"([|*`]|(?<=\w)_(?!\w))", r"\\\1", parts[i])
        if i and re.match(r"\w", parts[i]):  # markup ends before a letter only so
            parts[i] = "\\ " + parts[i]
    return bullet.group() + "".join(parts)


def skip_field(
    _app: Sphinx, _what: str, _name: str, obj: object, _skip: bool, _options: object
) -> bool | None:
    """Leaves out the fields of named tuples: the docstring of the class tells what they are."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def top_page(_app: Sphinx, page: str, text: list[str]) -> None:
    """Puts the text of a page at the top, with its links as seen from docs/, before the page's."""
    if page in TOP:
        top = (ROOT / TOP[page]).read_text()
        for name, file in TOP.items():
            top = top.replace(f"]({file})", f"](docs/{name}.md)")
        text[0] = re.sub(r"\]\((?!https?:|docs/)", "](../", top).replace("](docs/", "](") + text[0]


def setup(app: Sphinx) -> None:
    """Registers what this file adds to Sphinx."""
    app.add_transform(LinksToSources)
    app.add_directive("room", Room)
    app.add_directive("public-names", PublicNames)
    app.add_lexer("mermaid", TextLexer)
    app.connect("autodoc-skip-member", skip_field)
    app.connect("source-read", top_page)
    app.connect("html-collect-pages", source_pages)
    app.connect("autodoc-process-docstring", plain_text, priority=400)  # before napoleon
