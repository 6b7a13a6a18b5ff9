"""The manual as `make docs` builds it: its pages, and what its chapters print about a name."""

import fcntl
import pickle
import subprocess
import sys
from pathlib import Path

from docutils import nodes
from sphinx import addnodes

DOCS = Path(__file__).parents[2] / "docs"
BUILT = DOCS / "_build" / "html"


def build() -> Path:
    """Builds what is out of date, one process at a time, and returns the folder of the pages."""
    BUILT.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--keep-going", str(DOCS), str(BUILT)]
    with (BUILT / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(command, check=True)
    return BUILT


def printed(folder: Path) -> dict[str, str]:
    """The text about every documented name, without that about its members."""
    found: dict[str, str] = {}
    for path in sorted((folder / ".doctrees" / "api").glob("*.doctree")):
        document = pickle.loads(path.read_bytes())  # noqa: S301 - our own, just built
        for entry in document.findall(addnodes.desc):
            content = entry.next_node(addnodes.desc_content)
            own = [part.astext() for part in content.children if not isinstance(part, addnodes.desc | nodes.comment)]
            for signature in entry.findall(addnodes.desc_signature):
                if signature.parent is entry:
                    found.update({name: " ".join(own).strip() for name in signature["ids"]})
    return found
