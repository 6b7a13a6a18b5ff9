"""The contents on the start page: pages that no list there names follow under a caption of their own."""

import re

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

START = "index"
MARK = "% Pages that no list on this page names follow here.\n"
CAPTION = "More how-to"


def unlisted(text: str, pages: set[str]) -> list[str]:
    """Pages of the top folder that no list of contents in a text names, sorted."""
    lists = re.findall(r"```\{toctree\}\n(.*?)```", text, flags=re.DOTALL)
    listed = {re.sub(r".*<(.*)>$", r"\1", line.strip()) for block in lists for line in block.splitlines()}
    return sorted(page for page in pages - listed - {START} if "/" not in page)


def list_rest(app: Sphinx, name: str, source: list[str]) -> None:
    """Puts the list in place of the mark."""
    if name != START:
        return
    rest = unlisted(source[0], set(app.env.found_docs))
    listing = "\n".join([f'```{{toctree}}\n:caption: "{CAPTION}"\n:hidden:\n', *rest, "```\n"]) if rest else ""
    source[0] = source[0].replace(MARK, listing)


def read_start_again(
    _app: Sphinx, _env: BuildEnvironment, added: set[str], _changed: set[str], removed: set[str]
) -> list[str]:
    """The start page is out of date when pages come or go."""
    return [START] if added | removed else []


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", list_rest)
    app.connect("env-get-outdated", read_start_again)
    return {"parallel_read_safe": True}
