"""Which changes to a file no test notices: mutants killed and survived, each survivor shown.

python benchmarks/mutation.py schedulers/analytics/published/dems.py --sample 60
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from _mutants import Mutant, MutationRun, matching_tests, package_path, sample
from _report import Report

ROOT = Path(__file__).resolve().parent.parent


def main(
    sources: Annotated[list[Path], typer.Argument(help="Source files to mutate.")],
    tests: Annotated[
        list[str] | None,
        typer.Option(help="Tests to run, relative to the root; again for more. Default: matching."),
    ] = None,
    number: Annotated[
        int, typer.Option("--sample", help="Mutants of each file, drawn at random; 0 for all.")
    ] = 0,
    seed: Annotated[int, typer.Option(help="Of the random sample.")] = 1,
    jobs: Annotated[int, typer.Option(help="Mutants at once.", min=1)] = 1,
    words: Annotated[  # noqa: FBT002 - an option of a command line
        bool, typer.Option("--words", help="Also what changes nothing but a text.")
    ] = False,
    root: Annotated[Path, typer.Option(help="The project's folder.")] = ROOT,
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """Break a file in small ways, one at a time, and see whether a test fails.

    Each mutant is one change made by mutmut: a comparison turned, a number plus one, an argument
    left out, a value replaced by None. "Killed" is a mutant for which a test failed (or hung);
    each "survived" is printed as FILE:LINE with the change, "untested" where no test reached it.
    A survivor is a missing test or, now and then, a change that makes no difference.

    The tests are those in the folder of tests/ that mirrors the file's, and those that import the
    file's module; without Ray and without those marked slow, sitl or wall_clock. Name faster or
    better ones with --tests. Messages of exceptions are left alone, other texts unless --words,
    and so are decorated functions, properties among them, which mutmut does not mutate. All happens
    in a temporary copy of the project, which is removed at the end.

    Needs `pip install -e .[dev]`. Sampling 60 mutants of one file takes one to three
    minutes; on a machine that others use, put `nice -n 10` before it.
    """
    if importlib.util.find_spec("mutmut") is None:
        sys.exit("mutmut is not installed; run: pip install -e .[dev]")
    root = root.resolve()
    missing = [str(path) for path in sources if not path.is_file()]
    if missing:
        sys.exit(f"no such file: {', '.join(missing)}")
    modules = [package_path(root, source) for source in sources]
    chosen = tests or sorted({path for module in modules for path in matching_tests(root, module)})
    if not chosen:
        sys.exit("no test matches; name some with --tests")
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        run = MutationRun(root, Path(folder), modules, chosen)
        try:
            run.prepare()
        except RuntimeError as error:
            sys.exit(str(error))
        drawn = run.mutants(words=words)
        if number:
            drawn = sample(drawn, number, seed)
        run.run(drawn, jobs)
        names = {mutant.name for mutant in drawn}
        done = [mutant for mutant in run.mutants(words=words) if mutant.name in names]
    for mutant in done:
        if not mutant.killed:
            print(f"{mutant.file}:{mutant.line}: {mutant.verdict}\n{mutant.diff}\n")
    _show(done, chosen, json)


def _show(done: list[Mutant], tests: list[str], json: Path | None) -> None:
    units = {"mutants": "", "killed": "", "survived": "", "untested": "", "share killed": "%"}
    report = Report("mutation", units, packages=["mutmut"])
    files = list(dict.fromkeys(mutant.file for mutant in done))
    for case in [*files, "all"] if len(files) != 1 else files:
        of_case = [mutant for mutant in done if case in ("all", mutant.file)]
        count = {
            verdict: sum(mutant.verdict == verdict for mutant in of_case)
            for verdict in ("killed", "survived", "untested")
        }
        share = 100 * count["killed"] / len(of_case) if of_case else float("nan")
        report.row(case, {"mutants": len(of_case), **count, "share killed": share})
    report.note(f"Tests: {' '.join(tests)}")
    report.show()
    if json:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
