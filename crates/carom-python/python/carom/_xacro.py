"""Expansion of xacro files by the package ``xacro``."""

import contextlib
import io
import sys
import threading
import types
import warnings

from . import _carom
from ._errors import UrdfError

# The package keeps its state in its module.
_one_at_a_time = threading.Lock()


@contextlib.contextmanager
def _packages(folder, package_dirs):
    """``$(find NAME)`` as carom finds packages: xacro asks ``ament_index_python``, which ROS 2 alone has."""
    index = types.ModuleType("ament_index_python.packages")
    index.get_package_share_directory = lambda name: str(_carom.find_package(name, folder, package_dirs))
    package = types.ModuleType("ament_index_python")
    package.packages = index
    mine = {"ament_index_python": package, "ament_index_python.packages": index}
    before = {name: sys.modules.get(name) for name in mine}
    sys.modules.update(mine)
    try:
        yield
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


class _Arguments(dict):
    """The arguments, and the names that a file asks for."""

    def __init__(self, given):
        super().__init__({name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in given.items()})
        self.asked = set()

    def __contains__(self, name):
        self.asked.add(name)
        return super().__contains__(name)

    def __getitem__(self, name):
        self.asked.add(name)
        return super().__getitem__(name)


def expand(path, given, package_dirs):
    """The URDF of a xacro file, with these arguments (a dict, or None), as a text."""
    try:
        import xacro
    except ImportError:
        raise UrdfError(f"{path}: the file is xacro: install the package that expands it, pip install xacro") from None
    arguments = _Arguments(given or {})
    said = io.StringIO()
    with _one_at_a_time, _packages(str(path.parent), [str(folder) for folder in package_dirs]), contextlib.redirect_stderr(said):
        try:
            document = xacro.process_file(str(path), mappings=arguments)
        except Exception as error:  # The package lets those of the XML parser, of files and of expressions through.
            xacro.print_location()
            why, where = (" ".join(text.split()) for text in (str(error), said.getvalue()))
            raise UrdfError(f"{path}: xacro refuses the file: {why} ({where})") from error
    unknown = sorted(set(given or {}) - arguments.asked)
    if unknown:
        known = ", ".join(sorted(arguments.asked)) or "none"
        raise UrdfError(f"{path}: the file has no argument {', '.join(unknown)}; its arguments: {known}")
    if said.getvalue():
        warnings.warn(f"{path}: {said.getvalue().strip()}", stacklevel=2)
    return document.toprettyxml(indent=" ")
