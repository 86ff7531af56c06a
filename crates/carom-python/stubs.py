"""Writes what `python/carom/__init__.pyi` has from elsewhere, with the package installed: python stubs.py

- The types of properties are those of the getters in `src/`. A getter of a macro `getters! { CLASS, self, py { … } }` is a line
  `NAME: TYPE = …;`, or `NAME: TYPE, "STUB" = …;` with the type of the stub; the axes of an array are those of its documentation.
  Properties that are not in the stub yet are added after those of their class.
- The docstrings are those of the package.
- Classes that cannot be called have a `__new__` that no call satisfies.
"""

import ast
import inspect
import pathlib
import re

import carom

HERE = pathlib.Path(__file__).parent
STUB = HERE / "python/carom/__init__.pyi"
TYPES = {
    "f64": "float", "usize": "int", "bool": "bool", "&str": "str", "&'static str": "str", "String": "str", "Array<'py>": "_Floats",
    "Py<PyAny>": "_Floats", "RunEvent": "Event",
}
CLASSES = {"RunEvent": "Event", "FitResult": "Fit", "KnownLaw": "Law"}
# The docstring of a class, if it has one.
DOC = r'(?:    """(?:(?!""").)*"""\n)?'
NO_CALL = "    def __new__(cls, _: Never, /) -> Self: ...\n"


def stub(rust, doc):
    """The type of a stub for a type of Rust."""
    for outer, form in (("Vec", "list[{}]"), ("Option", "{} | None"), ("BTreeMap", "dict[{}]")):
        if inner := re.fullmatch(rf"{outer}<(.*)>", rust):
            return form.format(", ".join(stub(part, doc) for part in inner[1].split(", ")))
    kind = TYPES.get(rust, rust)
    axes = re.search(r"shape \((\w+),( \w+)?\)", doc) if kind == "_Floats" else None
    return ("_Matrix" if axes[2] else "_Vector") if axes else kind


def getters():
    """The getters of the sources: class, name and type of the stub."""
    for path in sorted((HERE / "src").glob("*.rs")):
        for block in re.finditer(r"^getters! \{ (\w+), self, py \{\n(.*?)^\} \}", path.read_text(), flags=re.DOTALL | re.MULTILINE):
            owner = CLASSES.get(block[1], block[1])
            for name, rust, own in re.findall(r'^    (\w+): (.+?)(?:, "(.+?)")? = ', block[2], flags=re.MULTILINE):
                yield owner, name, own.replace("'", '"') or stub(rust, vars(getattr(carom, owner))[name].__doc__)


def with_properties(text):
    """The stub with the getters."""
    for owner, name, kind in getters():
        head, body, rest = re.fullmatch(rf'(.*?^class {owner}\b[^\n]*:\n{DOC})(.*?)(^\S.*)', text, flags=re.DOTALL | re.MULTILINE).groups()
        line = f"    def {name}(self) -> {kind}:"
        body, found = re.subn(rf"^    def {name}\(self\) -> [^\n]*?:(?=\n| \.\.\.$)", lambda _: line, body, flags=re.MULTILINE)
        text = head + (body if found else f"    @property\n{line} ...\n{body}") + rest
    return text


def without_calls(text):
    """The stub in which classes that cannot be called are not."""
    for name in carom.__all__:
        found = getattr(carom, name)
        if not isinstance(found, type) or found.__module__ != "carom":
            continue
        try:
            found()
            refused = False
        except TypeError as error:
            refused = "cannot create" in str(error)
        if refused and f"\n{NO_CALL}" not in re.search(rf"^class {name}:.*?(?=^\S|\Z)", text, flags=re.DOTALL | re.MULTILINE)[0]:
            put = lambda found: f"class {name}:\n{found[2] or ''}{NO_CALL}"
            text = re.sub(rf"^class {name}:( \.\.\.)?\n({DOC})", put, text, flags=re.MULTILINE | re.DOTALL)
    return text


def documented(text):
    """The stub with the docstrings of the package; of overloads the first has it."""
    edits, seen = [], set()

    def visit(nodes, owner, indent):
        for node in nodes:
            if not isinstance(node, (ast.ClassDef, ast.FunctionDef)) or node.name.startswith("_") or (owner, node.name) in seen:
                continue
            found = getattr(carom, node.name, None) if owner is None else vars(owner).get(node.name)
            found = getattr(found, "__func__", found)
            if isinstance(node, ast.ClassDef):
                visit(node.body, found, indent + "    ")
            seen.add((owner, node.name))
            if doc := inspect.getdoc(found):
                edits.append((node, doc, indent + "    "))

    visit(ast.parse(text).body, None, "")
    lines = [line.encode() for line in text.splitlines(keepends=True)]
    for node, doc, indent in sorted(edits, key=lambda edit: -edit[0].body[0].lineno):
        first = node.body[0]
        quoted = f'"""{doc}"""' if "\n" not in doc else f'"""{doc}\n"""'
        quoted = "\n".join(indent + line if line else line for line in quoted.replace("\\", "\\\\").splitlines())
        row, column = first.lineno - 1, first.col_offset
        is_text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        end = (first.end_lineno - 1, first.end_col_offset) if is_text else (row, column)
        before, after = lines[row][:column].rstrip(b" "), lines[end[0]][end[1] :]
        if not is_text:
            # A class with members: the text comes before the first, and before its decorators.
            row = min([first.lineno, *(one.lineno for one in getattr(first, "decorator_list", []))]) - 1
            lines.insert(row, quoted.encode() + b"\n")
            continue
        lines[row : end[0] + 1] = [(before + b"\n" if before.strip() else b"") + quoted.encode() + after]
    return b"".join(lines).decode()


def written(text):
    """The stub with all of these."""
    return documented(without_calls(with_properties(text)))


if __name__ == "__main__":
    STUB.write_text(written(STUB.read_text()))
