"""The suite by hand: cases of a kind from a seed, or files that failed before, each failing cause once."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .campaign import KEPT, SECONDS, run, summary
from .child import KINDS


def main() -> int:
    """Take the cases, print each cause of failure with one file that shows it, and say how often each came."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="files to take as the cases")
    parser.add_argument("--kind", choices=list(KINDS), default="loaders")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first case")
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="time of one use of a case")
    parser.add_argument("--keep", type=Path, default=KEPT, help="folder for files of cases that fail")
    asked = vars(parser.parse_args())
    found = run(**asked)
    print(summary(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
