"""Write tutorial.ipynb from tutorial.md: `python docs/notebook.py`."""

import json
import re
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
START = """\
import os

if os.path.basename(os.getcwd()) == "docs":  # the commands run in the root of the repository
    os.chdir("..")"""


def notebook(text: str) -> dict[str, Any]:
    """A notebook whose code cells are the ``sh`` and ``python`` blocks of a page; its text is in the other cells."""
    cells = [_cell("code", START)]
    for part in re.split(r"^(```(?:sh|python)\n.*?^```\n)", text, flags=re.DOTALL | re.MULTILINE):
        block = re.fullmatch(r"```(sh|python)\n(.*?)```\n", part, re.DOTALL)
        if block:
            cells.append(_cell("code", ("%%bash\n" if block[1] == "sh" else "") + block[2].rstrip()))
        elif part.strip():
            cells.append(_cell("markdown", part.strip()))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 4}


def _cell(kind: str, source: str) -> dict[str, Any]:
    cell = {"cell_type": kind, "metadata": {}, "source": source.splitlines(keepends=True)}
    return cell | ({"execution_count": None, "outputs": []} if kind == "code" else {})


if __name__ == "__main__":
    found = notebook((HERE / "tutorial.md").read_text(encoding="utf-8"))
    (HERE / "tutorial.ipynb").write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
