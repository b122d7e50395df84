"""Read the shapes whose paths a JSON file lists, and say of each in a line of JSON how that ended; a child of tests."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from shapeprog.data import Shape, load_all

for path in json.loads(Path(sys.argv[1]).read_text()):
    started = time.process_time()
    _, found = next(iter(load_all([path])))
    seconds = time.process_time() - started
    end = {"end": "a shape", "words": ""} if isinstance(found, Shape) else {"end": "an error", "words": str(found)}
    print(json.dumps({**end, "seconds": seconds}))
