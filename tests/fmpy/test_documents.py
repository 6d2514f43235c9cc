"""The code in the pages: Python that parses, commands that a shell reads."""

import ast
import re
import subprocess
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^ *```(\w+)\n(.*?)^ *```", re.S | re.M)


def blocks(language):
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("python/**/*.md")]:
        text = page.read_text()
        for found in BLOCK.finditer(text):
            if found[1] == language:
                line = text.count("\n", 0, found.start()) + 2
                yield f"{page.relative_to(ROOT)}:{line}", textwrap.dedent(found[2])


def test_python_parses():
    found = list(blocks("python"))
    assert len(found) > 10, found
    for where, code in found:
        ast.parse(code, where)


def test_commands_are_one_to_a_line():
    found = list(blocks("sh"))
    assert len(found) > 40, found
    for where, code in found:
        read = subprocess.run(["bash", "-n"], input=code, text=True, capture_output=True)
        assert read.returncode == 0, f"{where}: {read.stderr}"
        # A command after a comment of its line is lost when two lines are joined.
        joined = re.search(r"#.* (pip install|cargo run|cargo install|fmu build|fmu simulate) ", code)
        assert joined is None, f"{where}: {joined[0]}"
