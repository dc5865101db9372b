"""How the documentation is built; `make docs` runs it, and any warning fails."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from sphinx.application import Sphinx  # noqa: E402
from sphinx.errors import ExtensionError  # noqa: E402

from generators import write_pages  # noqa: E402  # found through the path above
from generators.offline import outside_requests  # noqa: E402

project = "impactcell"
author = "the impactcell maintainers"
release = installed_version("impactcell")
project_copyright = author

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "_generated", "generators"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
nitpicky = False

html_theme = "furo"
html_title = f"impactcell {release}"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_show_sphinx = False
html_copy_source = False

# Docstrings put code in single backticks.
default_role = "code"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_use_rtype = False
# Two classes may have a field of one name; prose in a docstring means neither.
suppress_warnings = ["ref.python"]

write_pages(HERE / "_generated")


def _check_offline(app: Sphinx, failure: Exception | None) -> None:
    asked = outside_requests(Path(app.outdir)) if failure is None else []
    if asked:
        raise ExtensionError("pages that ask something of the outside:\n" + "\n".join(asked))


def setup(app: Sphinx) -> None:
    """Have the finished pages looked at."""
    app.connect("build-finished", _check_offline)
