"""Writes the properties of `python/carom/__init__.pyi` with the types of the getters in `src/`: python stubs.py

A getter of a macro `getters! { CLASS, self, py { … } }` is a line `NAME: TYPE = …;`, or `NAME: TYPE, "STUB" = …;` with the type of the
stub. Properties that are not in the stub yet are added after those of their class.
"""

import pathlib
import re

HERE = pathlib.Path(__file__).parent
STUB = HERE / "python/carom/__init__.pyi"
TYPES = {
    "f64": "float", "usize": "int", "bool": "bool", "&str": "str", "&'static str": "str", "String": "str", "Array<'py>": "_Floats",
    "Py<PyAny>": "_Floats", "RunEvent": "Event",
}
CLASSES = {"RunEvent": "Event", "FitResult": "Fit", "KnownLaw": "Law"}


def stub(rust):
    """The type of a stub for a type of Rust."""
    for outer, form in (("Vec", "list[{}]"), ("Option", "{} | None"), ("BTreeMap", "dict[{}]")):
        if inner := re.fullmatch(rf"{outer}<(.*)>", rust):
            return form.format(", ".join(stub(part) for part in inner[1].split(", ")))
    return TYPES.get(rust, rust)


def getters():
    """The getters of the sources: class, name and type of the stub."""
    for path in sorted((HERE / "src").glob("*.rs")):
        for block in re.finditer(r"^getters! \{ (\w+), self, py \{\n(.*?)^\} \}", path.read_text(), flags=re.DOTALL | re.MULTILINE):
            for name, rust, own in re.findall(r'^    (\w+): (.+?)(?:, "(.+?)")? = ', block[2], flags=re.MULTILINE):
                yield CLASSES.get(block[1], block[1]), name, own.replace("'", '"') or stub(rust)


def written(text):
    """The stub with these getters."""
    for owner, name, kind in getters():
        head, body, rest = re.fullmatch(rf"(.*?^class {owner}\b[^\n]*:\n)(.*?)(^\S.*)", text, flags=re.DOTALL | re.MULTILINE).groups()
        line = f"    def {name}(self) -> {kind}: ...\n"
        body, found = re.subn(rf"^    def {name}\(self\) -> .*\n", lambda _: line, body, flags=re.MULTILINE)
        text = head + (body if found else f"    @property\n{line}{body}") + rest
    return text


if __name__ == "__main__":
    STUB.write_text(written(STUB.read_text()))
