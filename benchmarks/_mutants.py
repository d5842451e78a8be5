"""Mutates files of a project in a copy of it, by mutmut, and tells which mutants the tests kill."""

from __future__ import annotations

import ast
import difflib
import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Mutant", "MutationRun", "matching_tests", "package_path", "sample"]

KILLED = frozenset({1, 3, 36, -24, 24, 152, 255, -9, -11})
"""Exit codes of pytest and mutmut for a failed test, a timeout and a crash."""
UNTESTED = 33
"""mutmut's own code for a mutant that no test reaches."""
_NOT_COPIED = shutil.ignore_patterns(
    ".git", ".venv*", "__pycache__", "*.pyc", ".*_cache", ".hypothesis", "runs", "shared", "mutants"
)
_SELECTION = '''"""Leaves out what a mutation run has no time for: Ray, and long flights.

The fastest tests come first, so that a mutant is found by the cheapest that notices it; one that
loops for ever is ended after 20 times what its test takes; a failing property is not shrunk.
"""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

LEFT_OUT = ("slow", "sitl", "wall_clock")
STATS = Path("mutmut-stats.json")

settings.register_profile(
    "mutation",
    phases=(Phase.explicit, Phase.generate),
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("mutation")


def pytest_collection_modifyitems(config, items):
    kept = [
        item
        for item in items
        if "runtime" not in getattr(item, "fixturenames", ())
        and not any(item.get_closest_marker(name) for name in LEFT_OUT)
    ]
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    if STATS.exists():
        took = json.loads(STATS.read_text(encoding="utf-8"))["duration_by_test"]
        kept.sort(key=lambda item: took.get(item.nodeid, 0.0))
        for item in kept:
            patience = 5 + 20 * took.get(item.nodeid, 15.0)
            item.add_marker(pytest.mark.timeout(patience), append=False)
    items[:] = kept
'''


@dataclass(frozen=True)
class Mutant:
    """One changed line of one file: its place, what changed, and how the tests ended."""

    name: str
    file: str
    line: int
    diff: str
    code: int | None
    """The exit code of the tests, 0 where all passed; None before they ran."""

    @property
    def killed(self) -> bool:
        """Whether a test failed, crashed or never came to an end."""
        return self.code in KILLED

    @property
    def verdict(self) -> str:
        """``killed``, ``survived``, ``untested`` or, of mutmut's other codes, the code."""
        if self.killed:
            return "killed"
        return {0: "survived", UNTESTED: "untested"}.get(self.code or 0, f"code {self.code}")


def package_path(root: Path, source: Path) -> Path:
    """The file's path below the package it is imported from, relative to `root`.

    A folder beside a package that the package links to, such as ``schedulers/``, is imported
    through the link: ``aerodaas/schedulers/``. Raises ValueError for a file outside `root`.
    """
    path = Path(os.path.relpath(Path(os.path.abspath(source)), root))  # noqa: PTH100 - links stay
    if path.parts[0] == "..":
        raise ValueError(f"{source} is not in {root}")
    for link in sorted(root.glob("*/*")):
        if link.is_symlink() and link.resolve() == (root / path.parts[0]).resolve():
            return link.relative_to(root).joinpath(*path.parts[1:])
    return path


def matching_tests(root: Path, module: Path) -> list[str]:
    """Test files in the nearest folder that mirrors the module's, and those that import it."""
    inside = Path(*module.parts[1:])
    folder = next(place for place in inside.parents if (root / "tests" / place).is_dir())
    pattern = f"test_{inside.stem}*.py" if folder == Path() else "test_*.py"
    found = set((root / "tests" / folder).glob(pattern))
    dotted = ".".join(module.with_suffix("").parts)
    found |= {
        path
        for path in (root / "tests").rglob("test_*.py")
        if f"{dotted} import" in path.read_text(encoding="utf-8")
    }
    return sorted(path.relative_to(root).as_posix() for path in found)


class MutationRun:
    """The mutants of `modules`, made in the folder `work` from the project at `root`.

    `modules` are paths as `package_path` gives them, `tests` paths for pytest. `prepare` copies,
    mutates and runs the tests once; `mutants` lists what was made; `run` runs some of it.
    """

    def __init__(
        self, root: Path, work: Path, modules: Sequence[Path], tests: Sequence[str]
    ) -> None:
        self.root, self.modules, self.tests = root, tuple(modules), tuple(tests)
        self.copy = work / "project"
        self.plugins = work / "plugins"

    def prepare(self) -> None:
        """Copy, mutate, and learn which tests reach which function; raises RuntimeError."""
        shutil.copytree(self.root, self.copy, ignore=_NOT_COPIED)
        self.plugins.mkdir()
        (self.plugins / "mutation_selection.py").write_text(_SELECTION, encoding="utf-8")
        settings = self.copy / "pyproject.toml"
        before = settings.read_text(encoding="utf-8") if settings.exists() else ""
        settings.write_text(before + self._settings(), encoding="utf-8")
        # A name that is no mutant's: everything is made and timed, nothing is run.
        said = self._mutmut("none")
        if not (self.copy / "mutants" / "mutmut-stats.json").exists():
            raise RuntimeError(f"the tests do not pass on the code as it is:\n{said[-4000:]}")

    def mutants(self, *, words: bool = False) -> list[Mutant]:
        """All mutants, as run so far; with `words`, those that change only a text, too."""
        return [mutant for module in self.modules for mutant in self._of(module, words=words)]

    def run(self, mutants: Iterable[Mutant], jobs: int) -> None:
        """Run the tests that reach each mutant, `jobs` mutants at once."""
        names = [mutant.name for mutant in mutants if mutant.code != UNTESTED]
        if names:
            self._mutmut(*names, jobs=jobs)

    def _settings(self) -> str:
        tops = {module.parts[0] for module in self.modules}
        others = sorted(
            path.name
            for path in self.copy.iterdir()
            if path.name not in tops and not path.name.startswith(".")
        )
        values = {
            "source_paths": sorted(tops),
            "only_mutate": [module.as_posix() for module in self.modules],
            "also_copy": others,
            "pytest_add_cli_args": ["-pno:cacheprovider", "-pmutation_selection", "-oaddopts="],
            "pytest_add_cli_args_test_selection": self.tests,
            "do_not_mutate_patterns": [r"raise \w+"],
            "timeout_multiplier": 5,
            "use_git_change_detection": False,
            "track_dependencies": False,
        }  # fmt: skip
        lines = (f"{name} = {json.dumps(value)}" for name, value in values.items())
        return "\n[tool.mutmut]\n" + "\n".join(lines) + "\n"

    def _mutmut(self, *names: str, jobs: int = 1) -> str:
        search = os.pathsep.join(filter(None, [str(self.plugins), os.environ.get("PYTHONPATH")]))
        done = subprocess.run(  # noqa: S603 - our own words
            [Path(sys.executable).with_name("mutmut"), "run", "--max-children", str(jobs), *names],
            cwd=self.copy,
            env=os.environ | {"PYTHONPATH": search},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.stdout

    def _of(self, module: Path, *, words: bool) -> list[Mutant]:
        made = self.copy / "mutants" / module
        kept = made.with_suffix(".py.meta")
        if not kept.exists():
            return []
        codes: dict[str, int | None] = json.loads(kept.read_text("utf-8"))["exit_code_by_key"]
        stats = json.loads((self.copy / "mutants" / "mutmut-stats.json").read_text("utf-8"))
        reached = stats["tests_by_mangled_function_name"]
        original = _functions(self.copy / module)
        mutated = _functions(made)
        mutants = []
        for name, code in codes.items():
            mangled = name.rpartition(".")[2]
            function = mangled.partition("__mutmut_")[0]
            before, after = mutated[f"{function}__mutmut_orig"], mutated[mangled]
            if not words and _silent(before) == _silent(after):
                continue
            start = original[_plain(function)].node.lineno
            line, diff = _difference(before.lines, after.lines)
            untested = not reached.get(name.partition("__mutmut_")[0])
            verdict = UNTESTED if untested else code
            mutants.append(Mutant(name, module.as_posix(), start + line, diff, verdict))
        return mutants


def sample(mutants: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """At most `count` mutants of each file, drawn by `seed`, in their order."""
    chosen: list[Mutant] = []
    for file in dict.fromkeys(mutant.file for mutant in mutants):
        of_file = [mutant for mutant in mutants if mutant.file == file]
        drawn = random.Random(seed).sample(range(len(of_file)), min(count, len(of_file)))
        chosen += [of_file[index] for index in sorted(drawn)]
    return chosen


@dataclass(frozen=True)
class _Function:
    node: ast.FunctionDef | ast.AsyncFunctionDef
    lines: list[str]


def _functions(path: Path) -> dict[str, _Function]:
    """Functions and methods of a file, by name; a method of `Class` as ``xǁClassǁname`` too."""
    text = path.read_text(encoding="utf-8")
    rows = text.splitlines()
    found: dict[str, _Function] = {}
    tree = ast.parse(text)
    for top in tree.body:
        inside = top.body if isinstance(top, ast.ClassDef) else [top]
        owner = f"{top.name}." if isinstance(top, ast.ClassDef) else ""
        for node in inside:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                function = _Function(node, rows[node.lineno - 1 : node.end_lineno])
                found[node.name if "__mutmut_" in node.name else owner + node.name] = function
    return found


def _plain(function: str) -> str:
    """The name ``xǁClassǁname`` or ``x_name`` as ``Class.name`` or ``name``."""
    if "ǁ" in function:
        return ".".join(function.split("ǁ")[1:])
    return function.removeprefix("x_")


def _silent(function: _Function) -> str:
    """The function's syntax tree without its name and its texts."""
    tree = ast.parse(ast.unparse(function.node))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and "__mutmut_" in node.name:
            node.name = "f"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree)


def _difference(before: list[str], after: list[str]) -> tuple[int, str]:
    """Lines below the function's first one at which they part, and the lines that differ."""
    pairs = difflib.SequenceMatcher(None, before[1:], after[1:], autojunk=False).get_opcodes()
    for kind, a, b, c, d in pairs:
        if kind != "equal":
            removed = [f"- {line.strip()}" for line in before[1 + a : 1 + b]]
            added = [f"+ {line.strip()}" for line in after[1 + c : 1 + d]]
            return 1 + a, "\n".join([*removed, *added])
    return 0, f"- {before[0].strip()}\n+ {after[0].strip()}"
