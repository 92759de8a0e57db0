"""Does a test notice when the code is wrong? A seeded sample of one-token faults, each against its mapped tests.

    python .ci/mutants.py                            300 mutants of kernels/, metrics/ and identification/
    python .ci/mutants.py --count 30 --seed 1        others
    python .ci/mutants.py --only metrics/_loop.py    those of one module among the sample
    python .ci/mutants.py --store mutants.json       resumes: a mutant is tried again if its module or tests changed
    python .ci/mutants.py --survivors                those that survived in the store, again
    python .ci/mutants.py --count 60 --packages kernels laws control files identification --circles
                                                     which circle of tests kills each?

A mutant is one change of a token: a comparison, an operator of arithmetic, a number, `min` for `max`, `and` for `or`, a
sign or an `abs` dropped, `True` for `False`. Half of the sample is from the kernels, a quarter each from the other two
packages. It is drawn by a hash of the mutant's own text, so that an edit elsewhere leaves the rest of it as it was.

Each mutant runs the test files that `MAPPED` names for its module, in a copy of the commit; for a module of another
package, the four that name its functions and classes most often. It is killed if a test fails, if the tests cannot be
collected, or if they take LONGER times as long as without a mutant. Survivors are printed last, with the reason why
each is harmless from `.ci/harmless_mutants.csv`; the exit status is 1 if one has no reason. With `--circles`, what
survives the first circle meets the second circle of the same files, and the last line says how many each has killed.

Run it in an environment that can run the tests; it takes an hour or two on two cores.
"""

import argparse
import ast
import csv
import functools
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Lock

ROOT = Path(__file__).resolve().parent.parent
HARMLESS = Path(__file__).with_name("harmless_mutants.csv")
SHARES = {"kernels": 0.5, "metrics": 0.25, "identification": 0.25}
CIRCLES = {"first": [], "second": ["-m", "page or smoke or digits or search or slow"]}
LONGER, LEAST = 4.0, 150.0  # times the run without a mutant; seconds, since a kernel must be compiled anew

STRUCTURES = "structures structures_static structure_studies structures_in_loops friction_in_structures"

# The quickest test first: the first failure ends a run.
MAPPED = {
    "kernels/loop.py": "actuator_stages actuator_chain close_loop",
    "kernels/branch.py": "branch a_new_family baber_noori",
    "kernels/batches.py": "composed clamp_operators coleman_hodgdon own_laws",
    "kernels/boucwen.py": "boucwen asymmetric",
    "kernels/boucwen_inverse.py": "inverse_undoes_response",
    "kernels/charts.py": "boucwen",
    "kernels/clamps.py": "clamp_operators extended_plays more_samples",
    "kernels/stepping.py": "composed more_samples own_laws static_models close_loop",
    "kernels/controllers.py": "pid close_loop tracking_controller",
    "kernels/duhem.py": "duhem duhem_memory branch",
    "kernels/elementary.py": "boucwen oscillator",
    "kernels/generalized.py": "asymmetric",
    "kernels/memory_terms.py": "discovery_refinement",
    "kernels/inverses.py": "inverse_of_every_law composed numeric_inverse",
    "kernels/linear.py": "transfer_function actuator_stages composed",
    "kernels/oscillator.py": "oscillator oscillator_identification",
    "kernels/play_sums.py": "clamp_operators extended_plays",
    "kernels/preisach.py": "more_samples preisach",
    "kernels/tracking.py": "tracking_controller shaping",
    "kernels/actuator_columns.py": "whole_actuator",
    "kernels/adaptive_inverse.py": "close_loop extreme_units",
    "kernels/anhysteretic.py": "jiles_atherton core_laws",
    "kernels/backlash.py": "friction",
    "kernels/chan.py": "core_laws",
    "kernels/components.py": "components",
    "kernels/copies.py": "called_twice close_loop tracking",
    "kernels/core_losses.py": "core_laws",
    "kernels/energy_plays.py": "core_laws inverse_of_every_law",
    "kernels/friction_rates.py": "friction",
    "kernels/jiles_atherton.py": "jiles_atherton",
    "kernels/jiles_atherton_inverse.py": "jiles_atherton inverse_of_every_law",
    "kernels/learning.py": "learning",
    "kernels/lugre.py": "friction",
    "kernels/maxwell.py": "friction",
    "kernels/predictive.py": "learning",
    "kernels/stribeck.py": "friction",
    "kernels/tellinen.py": "core_laws",
    "kernels/tellinen_table.py": "core_laws",
    "kernels/varying.py": "channels",
    "kernels/structure_ensembles.py": STRUCTURES,
    "kernels/structure_flows.py": STRUCTURES,
    "kernels/structure_layout.py": STRUCTURES,
    "kernels/structure_loop.py": STRUCTURES,
    "kernels/structure_moments.py": STRUCTURES,
    "kernels/structure_path.py": STRUCTURES,
    "kernels/structure_pointers.py": STRUCTURES,
    "kernels/structure_sweeps.py": STRUCTURES,
    "kernels/zhu_wang.py": "asymmetric branch",
    "metrics/_core_loss.py": "core_laws",
    "metrics/criteria.py": "fit_measures",
    "metrics/_cycle_table.py": "cycle_metrics",
    "metrics/_loop.py": "loop_metrics cycle_metrics core_laws",
    "metrics/_responses.py": "step_metrics loop_metrics",
    "metrics/rows.py": "loop_metrics",
    "identification/_admissible.py": "admissible warnings",
    "identification/_assumptions.py": "search noise",
    "identification/_channel.py": "channels",
    "identification/_choice.py": "choice smooth_density static_models",
    "identification/_identify.py": "identification identification_result several_records bad_data static_models noise",
    "identification/_descent.py": "search identification several_records",
    "identification/_noise.py": "warnings noise posterior",
    "identification/_problem.py": "identification several_records noise",
    "identification/_result.py": "identification_result",
    "identification/_search.py": "identification several_records choice comparison",
    "identification/_searched.py": "identification warnings identification_result bad_data",
    "identification/_select.py": "choice",
    "identification/_starts.py": "channels whole_actuator",
    "identification/_uncertainty.py": "identification warnings identification_result noise bad_data",
    "identification/likelihood.py": "search posterior",
    "identification/marquardt.py": "search discovery_refinement identification",
    "identification/doubts.py": "warnings identification_result bad_data",
}
NOT_MUTATED = {"kernels/_compile.py"}  # how kernels are compiled, not what they compute

COMPARISONS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "**": "*", "//": "/", "%": "*"}
NAMES = {"min": "max", "max": "min", "True": "False", "False": "True", "abs": "", "expm1": "exp", "log1p": "log"}
OPERATOR = re.compile(r"\*\*|//|<=|>=|==|!=|[-+*/%<>]|\bis not\b|\bis\b|\band\b|\bor\b")


@dataclass(frozen=True)
class Mutant:
    """The text from `start` to `end` of a module, replaced; `name` identifies it while other lines move."""

    module: str
    line: int
    start: int
    end: int
    new: str
    shown: str
    name: str

    def applied(self, source: str) -> str:
        """Source of the module with this fault."""
        return source[: self.start] + self.new + source[self.end :]


class Places(ast.NodeVisitor):
    """The places of a source at which a token can be changed: (start, end, replacement)."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.found: list[tuple[int, int, str]] = []

    def offset(self, line: int, column: int) -> int:
        start = self.starts[line - 1]
        text = self.source[start : self.starts[line]].encode()[:column]
        return start + len(text.decode())

    def begin(self, node: ast.expr) -> int:
        return self.offset(node.lineno, node.col_offset)

    def end(self, node: ast.expr) -> int:
        return self.offset(node.end_lineno or node.lineno, node.end_col_offset or node.col_offset)

    def between(self, left: ast.expr, right: ast.expr, table: dict[str, str]) -> None:
        """Replace the operator between two operands, if it is in the table."""
        first, last = self.end(left), self.begin(right)
        if (match := OPERATOR.search(self.source, first, last)) and match.group() in table:
            self.found.append((match.start(), match.end(), table[match.group()]))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Neither decorators, nor annotations, nor the docstring: defaults and the body."""
        for default in [*node.args.defaults, *(each for each in node.args.kw_defaults if each is not None)]:
            self.visit(default)
        for statement in node.body:
            self.visit(statement)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Messages are prose, which other tests read."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Text."""

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) != "TYPE_CHECKING":
            self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, right in zip([node.left, *node.comparators], node.comparators, strict=False):
            self.between(left, right, COMPARISONS)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if not isinstance(node.left, ast.Constant) or not isinstance(node.left.value, str):
            self.between(node.left, node.right, ARITHMETIC)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.between(node.target, node.value, ARITHMETIC)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.between(left, right, {"and": "or", "or": "and"})
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.USub, ast.Not)):
            start = self.begin(node)
            self.found.append((start, start + (1 if isinstance(node.op, ast.USub) else len("not ")), ""))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self.found.append((self.begin(node), self.end(node), str(not value)))
        elif isinstance(value, int):
            self.found.append((self.begin(node), self.end(node), str(value + 1)))
        elif isinstance(value, float):
            self.found.append((self.begin(node), self.end(node), repr(1.5 * value if value else 1.0)))

    def visit_Name(self, node: ast.Name) -> None:
        self.renamed(node, node.id, self.begin(node))

    def visit_Attribute(self, node: ast.Attribute) -> None:
        self.renamed(node, node.attr, self.end(node) - len(node.attr))
        self.generic_visit(node)

    def renamed(self, node: ast.expr, name: str, start: int) -> None:
        if name == "abs" and isinstance(node, ast.Attribute):
            return
        if name in NAMES:
            self.found.append((start, start + len(name), NAMES[name]))


def mutants(package: str) -> Iterator[Mutant]:
    """All mutants of the modules of a package."""
    for path in sorted((ROOT / "hysim" / package).rglob("*.py")):
        module = path.relative_to(ROOT / "hysim").as_posix()
        if module in NOT_MUTATED or path.name == "__init__.py":
            continue
        if package in SHARES and module not in MAPPED:
            raise SystemExit(f"{module} has no tests in MAPPED: name its test files there")
        source = path.read_text()
        places = Places(source)
        places.visit(ast.parse(source))
        seen: dict[str, int] = {}
        for start, end, new in sorted(set(places.found)):
            line = source.count("\n", 0, start) + 1
            before = source[source.rfind("\n", 0, start) + 1 : source.find("\n", end)]
            column = start - source.rfind("\n", 0, start) - 1
            after = before[:column] + new + before[column + end - start :]
            key = f"{module}: {before.strip()} -> {after.strip()}"
            seen[key] = seen.get(key, 0) + 1
            name = hashlib.sha256(f"{key} #{seen[key]}".encode()).hexdigest()[:12]
            yield Mutant(module, line, start, end, new, f"{before.strip()}   ->   {after.strip()}", name)


def sample(count: int, seed: int, shares: dict[str, float]) -> list[Mutant]:
    """`count` mutants, those whose hashes with the seed are the smallest."""
    chosen = []
    for package, share in shares.items():
        drawn = sorted(mutants(package), key=lambda each: hashlib.sha256(f"{seed} {each.name}".encode()).hexdigest())
        chosen += drawn[: round(share * count)]
    return chosen


@functools.cache
def tests_of(module: str) -> list[str]:
    """The test files of a module."""
    if module not in MAPPED:
        body = ast.parse((ROOT / "hysim" / module).read_text()).body
        defined = [each.name for each in body if isinstance(each, (ast.ClassDef, ast.FunctionDef))]
        used = re.compile(rf"\b({'|'.join(defined)})\b") if defined else re.compile(rf"\b{Path(module).stem}\b")
        counts = {path: len(used.findall(path.read_text())) for path in sorted((ROOT / "tests").glob("test_*.py"))}
        most = sorted(filter(counts.__getitem__, counts), key=counts.__getitem__, reverse=True)[:4]
        if most and module.startswith("laws/"):
            most.append(ROOT / "tests" / "test_families.py")  # which takes every law by its name
        return [path.relative_to(ROOT).as_posix() for path in most or counts]
    names = [f"tests/test_{name}.py" for name in MAPPED[module].split()]
    if missing := [name for name in names if not (ROOT / name).exists()]:
        raise SystemExit(f"{module} is mapped to {', '.join(missing)}, which is not there")
    return names


def state_of(module: str) -> str:
    """Hash of a module and its test files."""
    names = [f"hysim/{module}", *tests_of(module)]
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in names)).hexdigest()[:12]


def users(module: str) -> set[str]:
    """Stems of a kernel module and of those that use it: their compiled code is stale after a change."""
    imports = {path.stem: set() for path in (ROOT / "hysim" / "kernels").glob("*.py")}
    for stem, names in imports.items():
        for node in ast.walk(ast.parse((ROOT / "hysim" / "kernels" / f"{stem}.py").read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("hysim.kernels"):
                tail = node.module.split(".")[2:]
                names.update(tail or [alias.name for alias in node.names])
    stale = {Path(module).stem}
    while grown := {stem for stem, names in imports.items() if names & stale} - stale:
        stale |= grown
    return stale


class Copy:
    """A copy of the commit in which mutants are tried one after the other, with the code of its kernels compiled."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.cache, self.trial = folder, folder / ".compiled", folder / ".trial"
        self.seconds: dict[tuple[str, str], float] = {}
        folder.mkdir(parents=True)
        archive = subprocess.run(["git", "-C", ROOT, "archive", "HEAD"], stdout=subprocess.PIPE, check=True)
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
        shutil.copytree(ROOT / "tests", folder / "tests", dirs_exist_ok=True)

    def run(self, module: str, cache: Path, limit: float | None, circle: str) -> bool:
        """Whether the tests of a module in a circle pass within the limit [s]."""
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(self.folder), "MPLBACKEND": "agg"}
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        process = subprocess.Popen(
            [*command, *CIRCLES[circle], *tests_of(module)],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return process.wait(limit) in (0, 5)  # 5: this circle has no test in these files
        except subprocess.TimeoutExpired:
            return False
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def unharmed(self, module: str, circle: str) -> float:
        """Seconds that the tests of a module take without a mutant, its kernels compiled."""
        if (module, circle) not in self.seconds:
            if not self.run(module, self.cache, None, circle):
                raise SystemExit(f"the tests of {module} fail without a mutant: {' '.join(tests_of(module))}")
            start = time.monotonic()
            self.run(module, self.cache, None, circle)
            self.seconds[module, circle] = time.monotonic() - start
        return self.seconds[module, circle]

    def survives(self, mutant: Mutant, circle: str) -> bool:
        """Whether no test of the circle notices the mutant."""
        limit = max(LEAST, LONGER * self.unharmed(mutant.module, circle))
        path = self.folder / "hysim" / mutant.module
        source, times = path.read_text(), path.stat()
        cache = self.cache
        if mutant.module.startswith("kernels/"):
            cache = self.trial
            shutil.rmtree(cache, ignore_errors=True)
            stale = tuple(f"{stem}." for stem in users(mutant.module))
            shutil.copytree(self.cache, cache, ignore=lambda _, names: [n for n in names if n.startswith(stale)])
        elif mutant.module.startswith("laws/"):  # an equation is compiled into the kernels that step it
            cache = self.trial
            shutil.rmtree(cache, ignore_errors=True)
        path.write_text(mutant.applied(source))
        try:
            return self.run(mutant.module, cache, limit, circle)
        finally:
            path.write_text(source)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def explained() -> dict[str, str]:
    """Why a survivor is harmless, by the name of the mutant."""
    if not HARMLESS.exists():
        return {}
    with HARMLESS.open(newline="") as file:
        return {row["name"]: row["reason"] for row in csv.DictReader(file)}


def main() -> int:
    """Try the sample, print the outcome of each, then the survivors that nobody has explained."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="a part of the module's path")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--store", type=Path, help="JSON file of outcomes, read first and written after each mutant")
    parser.add_argument("--packages", nargs="+", help="in equal shares, in place of the usual three")
    parser.add_argument("--circles", action="store_true", help="let the second circle try what survives the first")
    parser.add_argument("--survivors", action="store_true", help="try those again that survived in the store")
    given = parser.parse_args()
    shares = dict.fromkeys(given.packages, 1.0 / len(given.packages)) if given.packages else SHARES
    chosen = [mutant for mutant in sample(given.count, given.seed, shares) if given.only in mutant.module]
    known = json.loads(given.store.read_text()) if given.store and given.store.exists() else {}
    outcomes = {
        mutant.name: known[mutant.name]["survived"]
        for mutant in chosen
        if mutant.name in known
        and known[mutant.name]["state"] == state_of(mutant.module)
        and not (given.survivors and known[mutant.name]["survived"])
    }
    if given.survivors:
        chosen = [mutant for mutant in chosen if known.get(mutant.name, {}).get("survived")]
    lock, by_second = Lock(), {name for name in outcomes if known[name].get("by") == "2nd only"}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(given.workers) as threads:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(given.workers):
            copies.put(Copy(Path(folder) / str(k)))

        def attempt(mutant: Mutant) -> None:
            copy, word = copies.get(), "killed"
            try:
                if (survived := copy.survives(mutant, "first")) and given.circles:
                    survived, word = copy.survives(mutant, "second"), "2nd only"
            finally:
                copies.put(copy)
            with lock:
                outcomes[mutant.name] = survived
                known[mutant.name] = {"survived": survived, "by": word, "state": state_of(mutant.module)}
                if word != "killed" and not survived:
                    by_second.add(mutant.name)
                place = f"{mutant.name} {mutant.module}:{mutant.line}  {mutant.shown}"
                print(f"{len(outcomes):4} {'SURVIVED' if survived else word:8} {place}", flush=True)
                if given.store:
                    given.store.write_text(json.dumps(known, indent=0))

        # mutants of one module after each other: a copy has then compiled and timed what it needs
        waiting = sorted((m for m in chosen if m.name not in outcomes), key=lambda m: (m.module, m.start))
        list(threads.map(attempt, waiting))
    reasons = explained()
    survivors = [mutant for mutant in chosen if outcomes[mutant.name]]
    open_ones = [mutant for mutant in survivors if mutant.name not in reasons]
    print(f"{len(chosen)} mutants, {len(chosen) - len(survivors)} killed, {len(survivors)} survived:")
    for mutant in survivors:
        why = reasons.get(mutant.name, "NOT EXPLAINED")
        print(f"  {mutant.name} {mutant.module}:{mutant.line}  {mutant.shown}\n      {why}")
    if given.circles:
        alone = len(by_second)
        print(f"{len(chosen) - len(survivors) - alone} killed by the first circle, {alone} by the second alone")
    return 1 if open_ones else 0


if __name__ == "__main__":
    sys.exit(main())
