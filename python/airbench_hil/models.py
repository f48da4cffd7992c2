"""Model files and their reports from Python, held against their JSON schemas (docs/model-files.md)."""

from __future__ import annotations

import json
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from airbench_hil import programs, records, tasks
from airbench_hil.controllers import StrPath
from airbench_hil.errors import BOUND_BROKEN, GOOD, BadModel
from airbench_hil.records import Record
from airbench_hil.report import number_in_words
from airbench_hil.run import imported

ModelVerdict = Literal["nothing-missing", "named", "ambiguous", "outside-catalogue"]
Kind = Literal["model-file", "model-report"]


@dataclass(frozen=True)
class ModelNumber:
    """A fitted number of a model file."""

    name: str
    """As the file has it; "NAME of RECORD" and "start of STATE in RECORD" where each record has its own."""
    suspect: str | None
    """Term or suspect that it belongs to; None for a number of the model."""
    value: float
    """In `unit`."""
    unit: str
    standard_error: float | None
    """One, in `unit`; None where the records do not determine the number."""
    baseline: float | None
    """Fitted without what was named."""

    def __str__(self) -> str:
        return number_in_words(self.name, self.value, self.standard_error, self.unit)


@dataclass(frozen=True)
class Missing:
    """A suspect that the model lacks."""

    suspect: str
    place: str
    """Such as "equation of speed" or "output level"."""
    term: str
    """How it stands there."""
    share_explained: float
    """Share of what the model leaves that it explains on folds of the training records."""
    alternatives: tuple[str, ...]
    """Suspects that explain the records as well."""


@dataclass(frozen=True)
class Found:
    """A term of a search, which no suspect describes."""

    name: str
    place: str
    term: str
    """How it stands there."""
    variables: tuple[str, ...]
    """Inputs and states that it reads."""
    share_explained: float
    stability: float
    """Share of halves of the records in which the best term is one like it."""


@dataclass(frozen=True)
class Located:
    """Where what the model alone leaves comes from."""

    place: str
    variables: tuple[str, ...]
    share: float
    """Of what the model leaves, that a function of these explains there."""


@dataclass(frozen=True)
class Left:
    """What both models leave of an output of a record."""

    record: str
    output: str
    unit: str
    rms_before: float
    """By the model alone, in `unit`."""
    rms_after: float
    """By the extended model."""
    ratio: float | None
    """After over before."""
    rows: int
    """Samples that are compared."""


class ModelFile:
    """A model file that fits its schema. Names, units and expressions are checked by `explain` and `close_model`, which parse them."""

    def __init__(self, file: StrPath) -> None:
        """Reads a file.

        :raises BadModel: it is no TOML, or does not fit its schema; the text says where and why.
        :raises FileNotFoundError: there is none.
        """
        self.path = Path(file)
        try:
            self.data: dict[str, Any] = tomllib.loads(self.path.read_text(encoding="utf-8"))
            """All of the file."""
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise BadModel(self.path, [str(error)]) from None
        _expect(self.path, self.data, "model-file")
        self.name: str = self.data.get("name", self.path.stem)
        self.time: str = self.data.get("record", {}).get("time", "t_s")
        """Column of the time in its records."""

    def suspects(self) -> list[str]:
        """Names of its suspects, in the order of the file."""
        return [str(each.get("name", str(each.get("use", "")).partition("/")[2])) for each in self.data.get("suspects", [])]

    def explain(self, *, binaries: StrPath | None = None) -> str:
        """Equations, units and suspects in words: `discrepancy explain`.

        :raises ProgramFailed: a name, a unit or an expression is wrong, with file, line and column.
        """
        with tempfile.TemporaryDirectory(prefix="airbench-explain-") as folder:
            where = Path(folder)
            tasks.done("discrepancy", [str(programs.program("discrepancy", binaries)), "explain", str(self.path)], where, good=(GOOD,))
            return (where / "programs/discrepancy.txt").read_text(encoding="utf-8")

    def __repr__(self) -> str:
        return f"<ModelFile {self.path}: {self.name}>"


class ModelReport:
    """What `discrepancy close` found with a model file."""

    def __init__(self, report: StrPath) -> None:
        """Reads a report: its folder, or the file.

        :raises BadModel: it does not fit its schema; the text says where and why.
        :raises FileNotFoundError: there is none.
        """
        given = Path(report)
        file = given / "report.json" if given.is_dir() else given
        self.folder = file.parent
        try:
            self.data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
            """All of report.json."""
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise BadModel(file, [str(error)]) from None
        if isinstance(self.data, dict) and "headline" not in self.data and "summary" in self.data:
            raise BadModel(file, ["the report of a rig file: read it with airbench_hil.Report"])
        _expect(file, self.data, "model-report")
        self.name: str = self.data["name"]
        self.verdict: ModelVerdict = self.data["verdict"]
        self.headline: str = self.data["headline"]
        self.confirmed: bool | None = self.data["confirmed"]
        """Whether held-out records get better with what was named, and none worse; None without one, or where nothing was named."""
        self.taken_back: bool = self.data["taken_back"]
        """Whether a held-out record that gets worse takes back what `named` and `discovered` have."""
        self.adequate: bool = self.data["adequate"]
        """Whether the reported model leaves no more than noise and declared model error on the training records."""
        self.named = tuple(
            Missing(each["suspect"], each["place"], each["term"], each["share_explained"], tuple(each["alternatives"]))
            for each in self.data["named"]
        )
        self.discovered = tuple(
            Found(each["name"], each["place"], each["term"], tuple(each["variables"]), each["share_explained"], each["stability"])
            for each in self.data["discovered"]
        )
        """Terms of a search that no suspect describes; their coefficients are `report["NAME.k_found"]`."""
        self.located = None if (at := self.data["located"]) is None else Located(at["place"], tuple(at["variables"]), at["share"])
        """Where what the model alone leaves comes from, whatever the suspects are; None where no place explains enough of it."""
        self.training = tuple(Left(**each) for each in self.data["training"])
        self.held_out = tuple(Left(**each) for each in self.data["held_out"])
        """What both models leave of each output of each held-out record."""
        self.structure: dict[str, Any] = self.data["structure"]
        """What the records can tell apart: `undetermined`, `hidden`, `without_effect`, `twins`, `advice`."""
        self.notes: list[str] = self.data["notes"]
        self.parameters = tuple(
            ModelNumber(each["name"], each["suspect"], each["value"], each["unit"], each["standard_error"], each["baseline"])
            for each in self.data["parameters"]
        )
        """Numbers of the extended model."""
        self.probabilities: dict[str, float] = {each["suspect"]: each["probability"] for each in self.data["suspects"]}
        """Of each suspect beside the model alone, the most likely first."""

    def __getitem__(self, name: str) -> ModelNumber:
        """The number of that name, or of "SUSPECT.NAME" where several have it. Raises KeyError."""
        names = [(number, {number.name, f"{number.suspect}.{number.name}"}) for number in self.parameters]
        found = [number for number, known in names if name in known]
        if len(found) != 1:
            have = ", ".join(f"{each.suspect}.{each.name}" if each.suspect else each.name for each in self.parameters)
            raise KeyError(f"{self.name} has {'several' if found else 'no'} {name}; it has {have}")
        return found[0]

    @property
    def page(self) -> Path:
        """The page for people, report.html."""
        return self.folder / "report.html"

    @property
    def model_file(self) -> Path | None:
        """The model file with what was named, or found by a search; None where nothing was, or it is taken back."""
        file = self.folder / Path(self.data["model"]).name
        is_found = (self.named or self.discovered) and not self.taken_back
        return file if is_found and file.is_file() else None

    def __repr__(self) -> str:
        return f"<ModelReport {self.folder}: {self.verdict}: {self.headline}>"


def close_model(
    model: StrPath | ModelFile,
    train: Record | Sequence[Record],
    test: Record | Sequence[Record] = (),
    *,
    out: StrPath | None = None,
    discover: bool | None = None,
    threads: int | None = None,
    binaries: StrPath | None = None,
) -> ModelReport:
    """Finds which suspect a model file lacks against measured records, and writes the extended file: `discrepancy close`.

    :param model: a model file.
    :param train: records to fit: files, or frames of pandas with the columns of the model, the time as a column or as index.
    :param test: records that are used only to judge both models.
    :param out: folder of the results; None: a new one in ./runs.
    :param discover: where no suspect is named, searches for a term that none of them describes; None: if more than noise is left.
    :param threads: most threads that compute; None: all.
    :param binaries: folder of the programs; None: `programs.program` looks for them.
    :raises BadModel: the file does not fit its schema.
    :raises ProgramFailed: other bad input, with the program's message and exit code.
    """
    known = model if isinstance(model, ModelFile) else ModelFile(model)
    where = tasks.folder(out, "close")
    words = [str(programs.program("discrepancy", binaries)), "close", "--model", str(known.path), "--out", str(where)]
    words += [] if discover is None else ["--discover" if discover else "--no-discover"]
    words += ["--threads", str(threads)] if threads is not None else []
    for option, asked in (("train", train), ("test", test)):
        places = [where / "records" / f"{option}-{number}" for number, _ in enumerate(records.several(asked), 1)]
        files = [records.file(each, place, known.time) for each, place in zip(records.several(asked), places, strict=True)]
        words += [f"--{option}", *map(str, files)] if files else []
    # Of an earlier call: it would pass for this one's.
    (where / "report.json").unlink(missing_ok=True)
    tasks.done("discrepancy", words, where, good=(GOOD, BOUND_BROKEN))
    return ModelReport(where)


def schema(kind: Kind) -> dict[str, Any]:
    """The JSON schema (2020-12) of model files, or of their reports."""
    found: dict[str, Any] = json.loads(programs.file(f"{kind}.schema.json").read_text(encoding="utf-8"))
    return found


def errors(data: object, kind: Kind) -> list[str]:
    """What does not fit the schema, each with its place; empty where everything does.

    :raises ImportError: jsonschema is not installed: pip install 'airbench-hil[models]'
    """
    validator = imported("jsonschema", "models").Draft202012Validator(schema(kind))
    found = sorted(validator.iter_errors(data), key=lambda error: [str(step) for step in error.absolute_path])
    return [f"{_place(data, error.absolute_path)}{_reason(error)}" for error in map(_inmost, found)]


def _expect(file: Path, data: object, kind: Kind) -> None:
    if wrong := errors(data, kind):
        raise BadModel(file, wrong)


def _inmost(error: Any) -> Any:
    """Of alternatives the error of the one that was meant: `use` means a library's suspect; else the one that comes furthest."""
    while error.context:
        branches: dict[int, list[Any]] = {}
        for each in error.context:
            branches.setdefault(each.schema_path[0], []).append(each)
        if set(_names(error)) == {"written_suspect", "library_suspect"}:
            is_library = isinstance(error.instance, Mapping) and "use" in error.instance
            meant = branches.get(_names(error).index("library_suspect" if is_library else "written_suspect"))
            if meant is None:
                return error
        elif len({each.validator for each in error.context}) == 1:
            return error  # alternatives of one kind: all of them are named
        else:
            meant = min(branches.values(), key=len)
        error = max(meant, key=lambda each: len(each.path))
    return error


def _names(error: Any) -> list[str]:
    return [str(each.get("$ref", "")).rpartition("/")[2] for each in error.validator_value]


def _reason(error: Any) -> str:
    """In words of a model file where jsonschema's own are of JSON."""
    if error.validator == "required":
        return str(error.message).replace("'", "").replace("is a required property", "is missing")
    if error.validator == "additionalProperties" and error.validator_value is False:
        known = error.schema.get("properties", {})
        extra = ", ".join(repr(key) for key in error.instance if key not in known)
        return f"unknown key {extra}; there are {', '.join(sorted(known))}"
    if error.validator in ("oneOf", "anyOf"):
        keys = [key for each in error.validator_value for key in each.get("required", [])]
        if keys:
            given = [key for key in keys if isinstance(error.instance, Mapping) and key in error.instance]
            return f"one of {', '.join(keys)} is asked" + (f"; it has {' and '.join(given)}" if given else "")
        kinds = [str(each["type"]) for each in error.validator_value if "type" in each]
        return f"{error.instance!r} is none of {', '.join(kinds)}"
    return str(error.message)


def _place(data: object, path: Sequence[str | int]) -> str:
    """`suspects[2] (quadratic-drag).parameters.k: `; empty for the whole."""
    words, at = "", data
    for step in path:
        at = at[step]  # type: ignore[index]
        words += f"[{step}]" if isinstance(step, int) else f".{step}"
        if isinstance(step, int) and isinstance(at, Mapping) and isinstance(at.get("name", at.get("suspect")), str):
            words += f" ({at.get('name', at.get('suspect'))})"
    return f"{words.lstrip('.')}: " if words else ""
