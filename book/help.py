"""A preprocessor of mdBook: adds to each block of the book that is one command `carom … --help` the text that it prints."""

import json
import re
import subprocess
import sys

COMMAND = re.compile(r"```sh\ncarom (?:(\w+) )?--help\n```\n")


def program():
    """The path of carom. With an example Cargo chooses the features of dependencies as for `cargo test`, whose artefacts then serve."""
    command = ["cargo", "build", "-q", "--locked", "--bin", "carom", "--example", "planar2", "--message-format=json"]
    built = map(json.loads, subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout.splitlines())
    return next(it["executable"] for it in built if it.get("executable") and it["target"]["name"] == "carom")


def shown(block):
    arguments = [*filter(None, block.groups()), "--help"]
    ran = subprocess.run([CAROM, *arguments], check=True, stdout=subprocess.PIPE)
    lines = "\n".join(line.rstrip() for line in ran.stdout.decode().splitlines())
    return f"{block[0]}\n```text\n{lines}\n```\n"


def change(part):
    """Changes the content of all chapters."""
    for inner in part if isinstance(part, list) else part.values():
        if isinstance(inner, (dict, list)):
            change(inner)
    if isinstance(part, dict) and "content" in part:
        part["content"] = COMMAND.sub(shown, part["content"])


if sys.argv[1:2] != ["supports"]:
    # mdBook writes the pair of its settings and the book, and reads the book.
    _, book = json.load(sys.stdin)
    CAROM = program()
    change(book)
    json.dump(book, sys.stdout)
