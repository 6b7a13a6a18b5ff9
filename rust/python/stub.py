"""Writes the compiled module's docstrings into its stub, `envs/rover_gym/_core.pyi`: what `make stub` calls.

Docstrings have one source, the doc comments of `rust/python/src`. Signatures and types of the stub are written by hand.
"""

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

STUB = Path(__file__).parents[2] / "envs" / "rover_gym" / "_core.pyi"

Documented = ast.ClassDef | ast.FunctionDef


def nodes(stub: str) -> Iterator[tuple[str, Documented]]:
    """Every class, function and method of a stub with its dotted name, but for overloads after the first."""
    seen = set()
    for node in ast.parse(stub).body:
        members = node.body if isinstance(node, ast.ClassDef) else []
        for owner, one in [("", node), *((f"{node.name}.", member) for member in members)]:
            if isinstance(one, Documented) and (name := owner + one.name) not in seen:
                seen.add(name)
                yield name, one


def docstring(module: ModuleType, name: str) -> str | None:
    """The module's docstring of what has this dotted name; None for special methods and for the stub's own names."""
    owner, _, member = name.rpartition(".")
    if member.startswith("_") or owner.startswith("_"):
        return None
    doc = getattr(getattr(module, owner) if owner else module, member).__doc__
    return inspect.cleandoc(doc) if doc else None


def with_docstrings(stub: str, module: ModuleType) -> str:
    """The stub with the module's docstrings in place of its own."""
    lines = stub.encode().splitlines(keepends=True)  # the parser counts columns in bytes
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    text = stub.encode()
    documented = [(node, docstring(module, name)) for name, node in nodes(stub)]
    for node, doc in sorted(documented, key=lambda pair: pair[0].lineno, reverse=True):
        first = node.body[0]
        head_end = starts[first_line(first) - 1] + first.col_offset
        head = text[:head_end].rstrip()
        is_own = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        rest_of_body = node.body[1:] if is_own else node.body
        if isinstance(node, ast.FunctionDef) and rest_of_body:
            raise ValueError(f"{node.name}: a function of a stub has a docstring or ..., and nothing else")
        indent = " " * (node.col_offset + 4)
        if doc:
            body = f"\n{quoted(doc, indent)}"
            body += "\n\n" if rest_of_body else ""
        else:
            body = "\n" if rest_of_body else " ..."
        if rest_of_body:
            tail_start = starts[first_line(rest_of_body[0]) - 1]
        else:
            tail_start = starts[node.end_lineno - 1] + node.end_col_offset
        text = head + body.encode() + text[tail_start:]
    return module_docstring(text.decode(), module)


def module_docstring(stub: str, module: ModuleType) -> str:
    """The stub with the docstring of the module itself, which a stub begins with."""
    first = ast.parse(stub).body[0]
    after = stub.splitlines(keepends=True)[first.end_lineno :]
    return quoted(inspect.cleandoc(module.__doc__ or ""), "") + "\n" + "".join(after)


def first_line(node: ast.stmt) -> int:
    """Where a statement begins, with its decorators."""
    decorators = getattr(node, "decorator_list", [])
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def quoted(doc: str, indent: str) -> str:
    """A docstring as it stands in a stub."""
    if doc.startswith('"') or doc.endswith('"') or "\\" in doc or '"""' in doc:
        raise ValueError(f"a docstring that begins or ends with a quotation mark or holds a backslash: {doc!r}")
    lines = [f"{indent}{line}".rstrip() for line in doc.splitlines()]
    lines[0] = f'{indent}"""{doc.splitlines()[0]}'
    if len(lines) == 1:
        return f'{lines[0]}"""'
    return "\n".join([*lines, f'{indent}"""'])


if __name__ == "__main__":
    from rover_gym import _core

    STUB.write_text(with_docstrings(STUB.read_text(encoding="utf-8"), _core), encoding="utf-8")
