"""Settings of Sphinx for the documentation, which `make docs` writes to build/docs."""

import sys
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

typing.GENERATING_DOCUMENTATION = "shapeprog"  # jaxtyping then prints the annotations as they are written
sys.path.insert(0, str(Path(__file__).parent))

import generated  # noqa: E402

import shapeprog  # noqa: E402

project = "shapeprog"
author = copyright = "shapeprog contributors"
release = shapeprog.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
smartquotes = False  # options begin with two hyphens
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

html_theme = "furo"
html_math_renderer = "mathml"  # browsers draw it; pages need no script and no network
html_title = f"shapeprog {release}"
html_copy_source = False

# Types of other libraries, and parts of the package that have no entry on the page of the API.
nitpick_ignore_regex = [
    ("py:class", r"(numpy|torch|pathlib|os|collections|threading|typing)\..*|Path|'.*'"),
    ("py:class", r"_Array|Tensor|Float|Int|UInt8|Bool"),
    ("py:.*", r"shapeprog\..*|Fault|Card|Generator\.predict"),
]

autodoc_member_order = "bysource"
autodoc_typehints = "description"
napoleon_attr_annotations = False
napoleon_google_docstring = False
python_use_unqualified_type_names = True


class Generated(SphinxDirective):
    """A directive that is replaced by the Markdown that ``lines`` makes of its argument."""

    optional_arguments = 1
    lines: ClassVar[Callable[..., Iterator[str]]]

    def run(self) -> list[nodes.Node]:
        """The nodes of the text, with its headings as sections of the page."""
        parent = nodes.Element()
        parent.document = self.state.document
        text = "\n".join(type(self).lines(*self.arguments))
        self.state.nested_parse(StringList(text.split("\n"), "generated"), 0, parent, match_titles=True)
        return parent.children


def write_math(writer: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Write a formula as MathML."""
    try:
        writer.body.append(tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block)))
    except MathError as error:
        logging.getLogger(__name__).warning("formula: %s", error, location=node)
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the renderer of formulas and the directives ``{statements}`` and ``{commands}``."""
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    for make in (generated.statements, generated.commands):
        app.add_directive(make.__name__, type(make.__name__, (Generated,), {"lines": staticmethod(make)}))
    return {"parallel_read_safe": True}
