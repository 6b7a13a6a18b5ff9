"""Writes the stub of the compiled module, `envs/rover_gym/_core.pyi`: what `make stub` calls.

`types.pyi` beside this file has the types. All else is the module's: docstrings, signatures, bases, special methods.
"""

import ast
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

TYPES = Path(__file__).with_name("types.pyi")

STUB = Path(__file__).parents[2] / "envs" / "rover_gym" / "_core.pyi"

#: Special methods that the stub lists where a class has them.
SPECIAL = ast.parse("""
def __len__(self) -> int: ...
def __eq__(self, other: object, /) -> bool: ...
def __hash__(self) -> int: ...
def __reduce__(self) -> Any: ...
def __getnewargs__(self) -> tuple[Any, ...]: ...
def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]: ...
""").body

CAN_BE_SUBCLASSED = 1 << 10  # Py_TPFLAGS_BASETYPE


class Writer(ast.NodeTransformer):
    """Makes the stub of a module from its types: each visit turns a line of them into one of the stub."""

    def __init__(self, module: ModuleType) -> None:
        self.module = module
        #: Types of private names that stand for words of the module.
        self.known = {name: expression(text) for name, text in module._types.items()}
        #: Types of arguments by name, and those of them that a function has.
        self.usual: dict[str, str] = {}
        self.met: set[str] = set()
        self.owner: type | None = None
        self.documented: set[str] = set()

    def stub(self, types: str) -> str:
        """The stub, whose lines ruff sets."""
        tree = ast.parse(types)
        table = next(one for one in tree.body if isinstance(one, ast.Assign))
        tree.body.remove(table)
        self.usual = {one: text for text, names in ast.literal_eval(table.value).items() for one in names.split()}
        self.compare("the module", set(self.module.__all__), tree)
        tree.body[0] = docstring(self.module.__doc__ or "", "")
        made = ast.unparse(ast.fix_missing_locations(self.visit(tree)))
        if idle := sorted(self.usual.keys() - self.met):
            raise ValueError(f"no function has {', '.join(idle)}")
        return re.sub(r"\n\n(?=    (?:@|def ))", "\n", made)

    def compare(self, where: str, expected: set[str], node: ast.Module | ast.ClassDef) -> None:
        """Raises an error unless the types name just the members that are expected."""
        named = {name(one) for one in node.body}
        if missing := sorted(expected - named):
            raise ValueError(f"{where}: {TYPES.name} has no type for {', '.join(missing)}")
        if unknown := sorted(one for one in named - expected if not one.startswith("_")):
            raise ValueError(f"{where} has no {', '.join(unknown)}")

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name of words becomes these."""
        return self.known.get(node.id, node) if node.id.startswith("_") else node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.ClassDef:
        """A class gets its bases, decorators, docstring and special methods."""
        if node.name.startswith("_"):
            return node
        self.owner = owner = getattr(self.module, node.name)
        node.body = [one for one in node.body if not isinstance(one, ast.Expr)]
        if not issubclass(owner, Exception):
            if owner.__text_signature__ and "__new__" not in map(name, node.body):
                node.body[:0] = ast.parse("def __new__(): ...").body
            public = {one for one in vars(owner) if not one.startswith("_")}
            self.compare(node.name, public, node)
            if not owner.__flags__ & CAN_BE_SUBCLASSED:
                node.decorator_list = [ast.Name("final")]
            elif owner.__basicsize__ > object.__basicsize__:
                node.decorator_list = [ast.Name("disjoint_base")]
        node.bases = [ast.Name(base.__name__) for base in owner.__bases__ if base is not object]
        members = [self.visit(one) for one in node.body]
        special = [one for one in SPECIAL if vars(owner).get(one.name)]
        node.body = [docstring(owner.__doc__ or "", " " * 4), *members, *special]
        self.owner = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt | None:
        """A name with a type is a property in a class; the fields of exceptions and the module's own names stay."""
        if self.owner is None or issubclass(self.owner, Exception):
            if name(node) == "__all__":
                node.value = expression(repr(sorted(self.module.__all__)))
            return None if name(node) in self.known else self.generic_visit(node)
        found = vars(self.owner)[name(node)]
        if not inspect.isdatadescriptor(found):
            raise ValueError(f"{self.owner.__name__}.{name(node)} is no property")
        arguments = ast.arguments([], [ast.arg("self")], None, [], [], None, [])
        body = docstring(found.__doc__ or "", " " * 8)
        return ast.FunctionDef(
            name(node), arguments, [body], [ast.Name("property")], self.visit(node.annotation), lineno=0
        )

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """A function gets its signature and docstring."""
        owner, full = self.owner, f"{self.owner.__name__}.{node.name}" if self.owner else node.name
        found = owner if node.name == "__new__" else getattr(owner or self.module, node.name)
        typed = {one.arg: self.visit(one.annotation) for one in node.args.args}
        if owner and node.name != "__new__" and isinstance(vars(owner)[node.name], staticmethod):
            node.decorator_list.append(ast.Name("staticmethod"))
            own = []
        else:
            own = [ast.arg("cls" if node.name == "__new__" else "self")] if owner else []
        node.args = ast.arguments([], own, None, [], [], None, [])
        for one in inspect.signature(found).parameters.values():
            if one.name == "self":
                continue
            argument = ast.arg(one.name, typed.pop(one.name, None) or self.usual_type(full, one))
            default = (
                None if one.default is one.empty else expression("..." if one.default is ... else repr(one.default))
            )
            if one.kind is one.KEYWORD_ONLY:
                node.args.kwonlyargs.append(argument)
                node.args.kw_defaults.append(default)
            else:
                node.args.args.append(argument)
                node.args.defaults += [default] if default else []
        if typed:
            raise ValueError(f"{full} has no {', '.join(typed)}")
        usual = ast.Name(owner.__name__) if owner and node.name == "__new__" else ast.Constant(None)
        node.returns = self.visit(node.returns) if node.returns else usual
        if not node.name.startswith("_") and full not in self.documented:
            node.body = [docstring(found.__doc__ or "", " " * (8 if owner else 4))]
        self.documented.add(full)  # of overloads the first
        return node

    def usual_type(self, full: str, one: inspect.Parameter) -> ast.expr:
        """Type of an argument for which the function gives none: that of an option, of its name, or of its default."""
        options = self.module._options.get(getattr(self.owner, "__name__", None), {})
        if one.name in options:
            return expression(options[one.name])
        if one.name in self.usual:
            self.met.add(one.name)
            return self.visit(expression(self.usual[one.name] + (" | None" if one.default is None else "")))
        if type(one.default) in (bool, int, float, str):
            return ast.Name(type(one.default).__name__)
        raise ValueError(f"{full}: {TYPES.name} has no type for the argument {one.name}")


def name(node: ast.stmt) -> str:
    """The name that a line of the types is about; "_" for imports and docstrings."""
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    return target.id if isinstance(target, ast.Name) else getattr(node, "name", "_")


def expression(text: str) -> Any:
    """A Python expression, parsed."""
    return ast.parse(text, mode="eval").body


def docstring(doc: str, indent: str) -> ast.Expr:
    """A docstring as it stands in a stub."""
    lines = inspect.cleandoc(doc).splitlines()
    end = [indent] if len(lines) > 1 else []
    rest = [indent + line if line else "" for line in lines[1:]]
    return ast.Expr(ast.Constant("\n".join([*lines[:1], *rest, *end])))


if __name__ == "__main__":
    from rover_gym import _core

    STUB.write_text(Writer(_core).stub(TYPES.read_text(encoding="utf-8")), encoding="utf-8")
