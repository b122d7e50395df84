"""Whether an ending is a good one: a result, or an error of ours in words that a user understands."""

from __future__ import annotations

import re
import traceback
import unicodedata
from pathlib import Path

from shapeprog.errors import InputError, ProgramError, ShapeProgError

RAW = re.compile(
    r"object has no attribute|Traceback|NoneType|not subscriptable|not iterable|not callable|unhashable|invalid literal"
    r"|codec can't|out of bounds|out of range|index \d+ is|unpack|must be str|cannot reshape|could not convert"
    r"|(keyword|positional|required) argument|Invalid argument|not supported between|<class '|list index"
    r"|cannot be interpreted|broadcast|buffer size|\[Errno|dtype\(|operand|dictionary|numpy|trimesh|\b0x[0-9a-f]{6,}"
    r"|no len|\b[A-Z]\w*(Error|Exception|Warning)\b"
)
"""Text that Python and its libraries write for programmers."""

LONGEST = 1500
"""Characters of an error."""

_MEMORY = re.compile(r"can't allocate|bad_alloc|Unable to allocate|[Oo]ut of memory|Cannot allocate")


def complaint(error: BaseException, path: Path) -> str:
    """What is wrong with an error as the answer to the file ``path``; nothing where it is a good one."""
    parsing = isinstance(error, ProgramError)  # Python's parser calls it that where brackets nest too deeply
    if not parsing and any(isinstance(each, MemoryError) or _MEMORY.search(str(each)) for each in _chain(error)):
        return "memory"
    if isinstance(error, AssertionError):
        return "bad result"
    if not isinstance(error, ShapeProgError):
        return "foreign exception"
    text = str(error)
    if RAW.search(_unquoted(error.message.replace(path.stem, ""), path)):
        return "raw Python text"
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in text.replace("\n", "")):
        return "unprintable"
    if len(text) > LONGEST:
        return "too long"
    if isinstance(error, (InputError, ProgramError)) and path.stem not in text:
        return "no name"
    return "" if error.hint else "no cure"


def _unquoted(message: str, path: Path) -> str:
    """A message without what it quotes from the file: that may be any text, such as the name of a library."""
    content = path.read_bytes()
    return re.sub(r"'([^']+)'", lambda found: "" if found[1].encode() in content else found[0], message)


def place(error: BaseException) -> str:
    """The innermost functions of an error: ours, and the library's where that is another."""
    steps = (step for each in _chain(error) for step, _ in traceback.walk_tb(each.__traceback__))
    return innermost([(step.f_code.co_filename, step.f_code.co_name) for step in steps])


def innermost(frames: list[tuple[str, str]]) -> str:
    """The last frame in the package, and the last of all, of (file, function) from the outermost inwards."""
    ours = [frame for frame in frames if "/shapeprog/" in frame[0]]
    chosen = [*ours[-1:], *(frames[-1:] if frames[-1:] != ours[-1:] else [])]
    return " > ".join(f"{_short(file)}:{function}" for file, function in chosen)


def _short(file: str) -> str:
    return "/".join(Path(file).parts[-2:])


def _chain(error: BaseException) -> list[BaseException]:
    """The error and its causes, the first cause last."""
    found: list[BaseException] = []
    following: BaseException | None = error
    while following is not None and following not in found:
        found.append(following)
        following = following.__cause__ or following.__context__
    return found
