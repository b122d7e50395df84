"""Programs and their tensors as JSON: versioned, with names, exact for every float32.

{"format": "shapeprog", "version": 1, "program": [
  {"statement": "translate", "parameters": {"count": 2, "by": [0, 0, 18]}, "body": [
    {"statement": "leg", "parameters": {"at": [-12, -8, -10], "size": [16, 2, 2]}}]}]}
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, NoReturn

import torch

from shapeprog.errors import InputError, ProgramError, ShapeProgError, did_you_mean
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_dict, frame_from
from shapeprog.formats.shape import LARGEST_FILE, read_text
from shapeprog.language.parameters import LARGEST, Parameter
from shapeprog.language.place import proper_text
from shapeprog.language.program import DEEPEST, Draw, Loop, Node, Program
from shapeprog.language.statement import SLOTS, Statement, language
from shapeprog.language.tensors import Code
from shapeprog.language.text import checked_role
from shapeprog.space import AXES, Frame

FORMAT, CODE_FORMAT = "shapeprog", "shapeprog-code"
VERSION = 1


@dataclass(frozen=True)
class Result:
    """A JSON file: a program, and what else there was to say about it.

    Parameters
    ----------
    name
        What the file is called in errors.
    content
        Its entries, of which only the form and its version have been looked at.
    """

    name: str
    content: dict[str, Any]

    @property
    def program(self) -> Program:
        """The program; an ``InputError`` if it is none."""
        return Program(_body(self.content.get("program"), self.name, "program", 0))

    @property
    def snapped(self) -> Program | None:
        """Its whole-numbered form where the file holds one; an ``InputError`` if that is no program."""
        body = self.content.get("snapped")
        return None if body is None else Program(_body(body, self.name, "snapped", 0))

    @property
    def frame(self) -> Frame | None:
        """The way to the world of the input where the file keeps it; an ``InputError`` if it is none."""
        kept = self.content.get("frame")
        return None if kept is None else frame_from(kept, self.name)

    @property
    def scores(self) -> dict[str, float]:
        """The measures that are finite numbers; whatever else a foreign file calls its scores is left out."""
        kept = self.content.get("scores")
        named = kept.items() if isinstance(kept, dict) else ()
        return {name: value for name, value in named if type(value) in (int, float) and abs(value) <= LARGEST}

    @property
    def source(self) -> str | None:
        """The file that the program was inferred from, as the file says."""
        source = self.content.get("source")
        return source if isinstance(source, str) else None


def read_result(path: Path) -> Result:
    """All that a JSON file holds.

    Raises
    ------
    ProgramError, InputError
        As for :func:`program_from_json`.
    """
    return Result(str(path), _document(read_text(path, LARGEST_FILE), str(path), FORMAT))


def read_json(path: Path) -> tuple[Program, Frame | None]:
    """The program of a JSON file, and its frame where it keeps one."""
    result = read_result(path)
    return result.program, result.frame


def write_json(program: Program, path: Path, frame: Frame | None) -> None:
    """Write the JSON form."""
    write_text(path, result_json(program, frame))


def result_json(program: Program, frame: Frame | None = None, **more: Any) -> str:
    """The JSON form of a program with its frame and whatever else there is to say, such as scores."""
    content = json.loads(program_to_json(program))
    if frame is not None:
        content["frame"] = frame_dict(frame)
    return json.dumps({**content, **more}, indent=2, allow_nan=False) + "\n"


def program_to_json(program: Program, indent: int | None = 2) -> str:
    """A program as JSON text; numbers have the fewest digits that read back exactly.

    Raises
    ------
    ShapeProgError
        If a number is not finite, a statement is not declared, or loops nest too deeply to be read back.
    """
    body = [_node_to_json(node, 0) for node in program.body]
    return json.dumps({"format": FORMAT, "version": VERSION, "program": body}, indent=indent) + "\n"


def program_from_json(text: str, name: str = "<json>") -> Program:
    """The program of a JSON text.

    Raises
    ------
    ProgramError
        If the text is not JSON, at its place.
    InputError
        If it is JSON of another kind, naming the entry.
    """
    return Result(name, _document(text, name, FORMAT)).program


def code_to_json(code: Code) -> str:
    """Program tensors as JSON text, exact for float32 and float64.

    Raises
    ------
    ShapeProgError
        If a parameter is not finite, which JSON cannot say.
    """
    if not bool(torch.isfinite(code.parameters).all()):
        raise ShapeProgError(
            "these program tensors hold numbers that are not finite", "JSON cannot say them; mend them"
        )
    content = {"ids": code.ids.tolist(), "parameters": code.parameters.detach().tolist()}
    if code.roles is not None:
        content["roles"] = code.roles.tolist()
    shape = {"dtype": str(code.parameters.dtype).removeprefix("torch."), "shape": list(code.ids.shape)}
    return json.dumps({"format": CODE_FORMAT, "version": VERSION, **shape, **content}) + "\n"


def code_from_json(text: str, name: str = "<json>") -> Code:
    """The program tensors of a JSON text.

    Raises
    ------
    ProgramError, InputError
        As for :func:`program_from_json`.
    """
    content = _document(text, name, CODE_FORMAT)
    dtype = {"float32": torch.float32, "float64": torch.float64}.get(str(content.get("dtype")))
    try:
        shape = [int(extent) for extent in content["shape"]]
        ids = torch.tensor(content["ids"], dtype=torch.long).reshape(shape)
        numbers = torch.tensor(content["parameters"], dtype=dtype)
        parameters = numbers.reshape(*shape, numbers.shape[-1] if numbers.numel() else SLOTS)
        roles = None
        if "roles" in content:
            roles = torch.tensor(content["roles"], dtype=torch.long).reshape(shape[:-1])
    except (KeyError, TypeError, ValueError, RuntimeError, OverflowError, IndexError) as error:
        raise InputError(
            f"{name}: ids and parameters are no tensors of programs",
            "ids are (..., blocks, steps), parameters as many numbers for each of them, shape that of the ids",
        ) from error
    if dtype is None or len(shape) < 2 or not bool(torch.isfinite(parameters).all()):
        raise InputError(f"{name}: these program tensors are incomplete", "write them with code_to_json")
    return Code(ids, parameters, roles)


def _node_to_json(node: Node, depth: int) -> dict[str, Any]:
    known = language()
    if node.name not in known:
        raise ShapeProgError(f"no statement is called {node.name!r}", "load the module that declares it")
    if depth > DEEPEST:
        raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
    parameters = {}
    for parameter in known[node.name].parameters:
        if not parameter.quantity.written_out:
            continue
        texts = [parameter.quantity.written(value) for value in node.values[parameter.slots]]
        numbers = texts if parameter.quantity.kind == "axis" else [json.loads(text) for text in texts]
        parameters[parameter.name] = numbers if parameter.quantity.width > 1 else numbers[0]
    found: dict[str, Any] = {"statement": node.name, "parameters": parameters}
    if isinstance(node, Draw) and node.role:
        found["role"] = checked_role(node)
    if isinstance(node, Loop):
        found["body"] = [_node_to_json(inner, depth + 1) for inner in node.body]
    return found


def _wanted(parameter: Parameter) -> str:
    return parameter.quantity.range_text if parameter.quantity.kind == "axis" else "a number"


def _document(text: str, name: str, wanted: str) -> dict[str, Any]:
    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{name}: {constant} is not a number of a program", "write finite numbers")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) != len(pairs):
            twice, _ = Counter(word for word, _ in pairs).most_common(1)[0]
            raise InputError(f"{name}: {shortened(twice)} is given twice in one entry", "leave one of them out")
        return found

    text = proper_text(text, name)
    try:
        content = json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        lines = text.split("\n")
        source = lines[min(error.lineno, len(lines)) - 1]
        raise ProgramError(
            f"this is not JSON: {error.msg}", line=error.lineno, column=error.colno, source=source,
            hint="was the file cut off?", name=name,
        ) from None  # fmt: skip
    except RecursionError:
        raise InputError(f"{name}: this is nested too deeply to be a program", "loops nest at most 64 deep") from None
    except ValueError as error:  # what Python says of a whole number of thousands of digits
        raise InputError(f"{name}: a number has too many digits to be read", "write shorter numbers") from error
    if not isinstance(content, dict) or content.get("format") != wanted:
        raise InputError(f"{name}: this JSON is not in the form {wanted!r}", f'it begins {{"format": "{wanted}", ...')
    if content.get("version") != VERSION:
        raise InputError(
            f"{name}: version {shortened(content.get('version'))} of the form {wanted!r} is not known",
            f"this program reads version {VERSION}; a newer one may read it",
        )
    return content


def _body(body: Any, name: str, place: str, depth: int) -> tuple[Node, ...]:
    if not isinstance(body, list):
        raise InputError(f"{name}: {place} is not a list of statements", "write [ ... ], empty if there are none")
    if depth > DEEPEST:
        raise InputError(f"{name}: loops are nested more than {DEEPEST} deep", "put some of them side by side")
    return tuple(_node(entry, name, f"{place}[{index}]", depth) for index, entry in enumerate(body))


def _node(entry: Any, name: str, place: str, depth: int) -> Node:
    if not isinstance(entry, dict) or not isinstance(entry.get("statement"), str):
        raise InputError(f"{name}: {place} is not a statement", 'write {"statement": name, "parameters": {...}}')
    known, word = language(), entry["statement"]
    if word not in known:
        raise InputError(f"{name}: {place}: no statement is called {shortened(word)}", did_you_mean(word, known.names))
    declared = known[word]
    allowed = {"statement", "parameters", "body" if declared.is_loop else "role"}
    extra = sorted(set(entry) - allowed)
    if extra:
        raise InputError(
            f"{name}: {place}: {word} has no entry {shortened(extra[0])}", f"it has {', '.join(sorted(allowed))}"
        )
    values = _values(declared, entry.get("parameters"), name, place)
    if not declared.is_loop:
        return Draw(word, values, _role(entry, word, name, place))
    return Loop(word, values, _body(entry.get("body"), name, f"{place}.body", depth + 1))


def _role(entry: dict[str, Any], word: str, name: str, place: str) -> str:
    role, roles = entry.get("role", ""), language().roles
    if not isinstance(role, str) or (role and role not in roles):
        raise InputError(f"{name}: {place}: no role is called {shortened(role)}", did_you_mean(str(role), roles))
    if role == word:
        raise InputError(f"{name}: {place}: {word} is a {word} without being called one", "leave the role out")
    return role


def _values(declared: Statement, given: Any, name: str, place: str) -> tuple[float, ...]:
    words = [parameter.name for parameter in declared.parameters]
    if not isinstance(given, dict):
        raise InputError(f"{name}: {place}: {declared.name} lacks its parameters", f"they are {', '.join(words)}")
    for word in given:
        if word not in words:
            raise InputError(
                f"{name}: {place}: {declared.name} has no parameter {shortened(word)}", did_you_mean(word, words)
            )
    values: list[float] = []
    for parameter in declared.parameters:
        if parameter.name not in given and parameter.unsaid is not None:
            values.append(parameter.unsaid)
            continue
        if parameter.name not in given:
            raise InputError(f"{name}: {place}: {declared.name} lacks {parameter.name}", f"it has {', '.join(words)}")
        found = given[parameter.name]
        numbers = found if isinstance(found, list) else [found]
        if parameter.quantity.kind == "axis":
            numbers = [float(AXES.index(each)) if each in AXES else each for each in numbers]
        if any(type(number) not in (int, float) for number in numbers):
            said = f"{parameter.name} of {declared.name} holds something that is not {_wanted(parameter)}"
            raise InputError(f"{name}: {place}: {said}", "write plain numbers such as 4 or -2.5")
        try:
            values += parameter.checked(declared.name, numbers)
        except ShapeProgError as mistake:
            raise InputError(f"{name}: {place}: {mistake.message}", mistake.hint) from None
    return tuple(values)
