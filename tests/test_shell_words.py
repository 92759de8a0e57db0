"""Errors and warnings name options as a shell takes them, and suggest the one that was meant."""

import ast
import inspect
import re
from pathlib import Path

import pytest
from strategies import refused_in_one_line

import hysim as hs
from hysim.cli import COMMANDS, Command
from hysim.cli.options import OTHER_NAMES, suggestion
from hysim.cli.outputs import flags, in_shell_words

FLAGS_OF = {name: flags(Command(name)) for name in COMMANDS}
FLAGS = {name: flag for flags_of_one in FLAGS_OF.values() for name, flag in flags_of_one.items()}
PACKAGE = Path(hs.__file__).parent
PYTHON_ONLY = (
    "paper",
    "export",
    "sweeps",
    "rig",
    "vision",
    "plot",
    "structures",
    "control",
    "plants",
    "cli",
    "_channel.py",
    "dependent.py",
    "dependent_structure.py",
    "varying.py",
    "tracking",
    "notebooks.py",
)


@pytest.fixture
def run(tmp_path, monkeypatch, shell):
    """Run a command in a folder with two records and a law: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{k},{u},{2 * u}\n" for k, u in enumerate([0, 1, 2, 1, 0]))
    (tmp_path / "loop.csv").write_text(f"t,u,y\n{rows}")
    (tmp_path / "latin.csv").write_bytes("u,y [µm]\n0,1\n1,2\n".encode("latin-1"))
    (tmp_path / "weg.csv").write_text("Weg,y\n0,1\n1,2\n")
    hs.save(hs.Line(slope=2.0), "law.json")
    return shell


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ('pass its encoding, for instance encoding="latin-1"', "pass its encoding, for instance --encoding latin-1"),
        ('pass decimal="," or delimiter=";"', "pass --decimal , or --delimiter ';'"),
        ("a.csv: resolution must be positive", "a.csv: --resolution must be positive"),
        ("max_evaluations must be at least 1", "--max-evaluations must be at least 1"),
        ('cross_validate must be "loo"', '--cross-validate must be "loo"'),
        ("load without time: t=False", "load without time: --no-t"),
        ("widen it with bounds=", "widen it with --bounds"),
        ("give bounds={'k': (lower, upper)}", "give --bounds k=LOWER:UPPER"),
        ("identify with fixed={'a': 0.5}", "identify with --fix a=0.5"),
        ("free=['damping', 'mass', ...], names", "--free damping --free mass ..., names"),
        ("give channels={'T': ...}", "give --channel T=COLUMN"),
        ('pass units="cm/s^2", or units=', "pass --unit u=cm/s^2, or --unit u=UNIT"),
        ("pass skip=3", "pass --skip 3"),
        ("got BoucWen(n=1.0, free=['n']) and seed=3", "got BoucWen(n=1.0, free=['n']) and --seed 3"),
        ("Record(resolution=...)", "--resolution"),
        ("interpolate it by hs.load(...).resample(0.1), or", "interpolate it by --t, --u and --sample-time 0.1, or"),
        ("the tolerance is small, and loops=3", "the tolerance is small, and loops=3"),
        ("no column 'y', the columns are: sample_time, u", "no column 'y', the columns are: sample_time, u"),
        ("t and sample_time exclude each other", "t and --sample-time exclude each other"),
        ("--unit u=V, u='V' and x.seed=1", "--unit u=V, u='V' and x.seed=1"),
        ("--noise=gaussian or noise=gaussian", "--noise=gaussian or noise=gaussian"),
    ],
)
def test_an_argument_of_the_library_becomes_an_option(message, words):
    assert in_shell_words(message, FLAGS) == words


def test_a_command_without_options_leaves_the_message_as_it_is():
    assert in_shell_words("pass encoding=", {}) == "pass encoding="


def texts(path):
    """Literal parts of the strings of a module that are no docstrings, as they may be in a message."""
    tree = ast.parse(path.read_text())
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            docs.update(map(id, node.values))
            yield "".join(part.value if isinstance(part, ast.Constant) else "0" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.value


def test_no_message_of_the_library_keeps_an_argument_that_is_an_option():
    names = "|".join(name for name in (*FLAGS, *OTHER_NAMES) if len(name) > 1)
    named = re.compile(rf"(?<![\w.-])({names})=")
    changed = 0
    for path in PACKAGE.rglob("*.py"):
        if any(part in PYTHON_ONLY for part in path.relative_to(PACKAGE).parts):
            continue  # their messages do not reach a command, or name methods of Python that have no option
        for text in texts(path):
            if " " in text and named.search(text):
                words = re.sub(r"\w+\([^()]*\)", "", in_shell_words(text, FLAGS))
                assert not named.search(words), (path, text, words)
                changed += 1
    assert changed > 20


READ_BY = {"files": "--encoding", "_load.py": "--on-missing"}
READ_BY |= dict.fromkeys(("_ground_motion.py", "records.py"), "--sample-time")
"""Where messages come from that reach the commands with an option alone: those that read texts, records or times."""
OPTIONS = {name: {*flags_of_one.values(), "--help"} for name, flags_of_one in FLAGS_OF.items()}
ADVISED = re.compile(r"(?:hysim (\w+) )?(?<![\w-])(--[a-z][\w-]*)")


@pytest.fixture(scope="module")
def messages():
    """Literals of the library that may name an argument or an option, with the parts of their module's path."""
    paths = [(path, path.relative_to(PACKAGE).parts) for path in PACKAGE.rglob("*.py")]
    every = [(parts, text) for path, parts in paths if not {*parts} & {*PYTHON_ONLY} for text in texts(path)]
    return [(parts, text) for parts, text in every if " " in text and re.search(r"--|\w=|hs\.|hysim\.", text)]


@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_in_a_message_is_one_of_the_command_or_named_with_another_one(name, messages):
    arguments = re.compile(rf"(?<![\w.\"'-])({'|'.join(each for each in (*FLAGS, *OTHER_NAMES) if len(each) > 2)})=")
    for parts, text in messages:
        if all(READ_BY.get(part, "--help") in OPTIONS[name] for part in parts):
            words = re.sub(r"\w+\([^()]*\)", "", in_shell_words(text, FLAGS_OF[name]))
            assert not arguments.search(words), (parts, words)
            assert all(option in OPTIONS[command or name] for command, option in ADVISED.findall(words)), (parts, words)


def test_every_option_in_an_error_that_a_command_raises_is_one_of_its_own():
    named = 0
    for name in OPTIONS:
        tree = ast.parse(inspect.getsource(Command(name).function))
        raised = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Raise)]
        for command, option in ADVISED.findall("\n".join(raised)):
            named += 1
            assert option in OPTIONS[command or name], name
    assert named > 10


def test_errors_of_the_library_name_options(run):
    assert run("metrics", "latin.csv")[2].endswith("for instance --encoding latin-1\n")
    few = "hysim metrics --tolerance ignores small turns of the input, hysim metrics --cycles measures"
    assert few in run("metrics", "loop.csv", "--cycles", "9")[2]
    assert few in run("compare", "loop.csv", "--model", "line", "--test-cycles", "3")[2]  # which has no --tolerance
    assert run("identify", "loop.csv", "--model", "line", "--resolution", "0")[2].endswith(
        "loop.csv: --resolution must be positive, got 0.0\n"
    )


test_a_typo_is_answered_with_what_was_meant = refused_in_one_line(
    (("metrics", "--U", "u", "loop.csv"), "there is no option --U: did you mean --u? (see hysim metrics --help)"),
    (("identify", "loop.csv", "--model", "line", "--fixed", "a=1"), "no option --fixed: did you mean --fix?"),
    (("identify", "loop.csv", "--model", "line", "--sampletime=1"), "did you mean --sample-time?"),
    (("metrics", "loop.csv", "loop.csv"), "Got unexpected extra argument (loop.csv) (see hysim metrics --help)"),
    (("identify", "loop.csv", "--model", "boucwem"), "did you mean bouc-wen? (models of your own: MODEL.json"),
    (("identify", "loop.csv", "--model", "Oscilator"), "did you mean oscillator?"),
    (("identify", "loop.csv", "--modle", "line"), "no option --modle: did you mean --model? (see hysim identify"),
    (("identify", "loop.csv", "--model", "lu-gree"), "did you mean lugre?"),
    (("identify", "loop.csv", "--model", "structure"), "a structure has no default: give one in a file"),
    (("identify", "loop.csv", "--model", "line", "--plays", "3"), "but of prandtl-ishlinskii, modified-prandtl-"),
    (("identify", "loop.csv", "--model", "line", "--bounds", "slope=3:1"), "'--bounds': expected NAME=LOW:HIGH"),
    (("plot", "loop.csv", "--kind", "lop"), "got 'lop': did you mean loop?"),
    (("help",), "there is no command 'help': did you mean --help?"),
    (("--verson",), "there is no option --verson: did you mean --version? (see hysim --help)"),
    (("metrics", "loop.csv", "--qqq", "1"), "there is no option --qqq (see hysim metrics --help)"),
)


test_a_wrong_step_is_answered_with_the_right_one = refused_in_one_line(
    (("metrics", "lopo.csv"), "lopo.csv: No such file or directory: did you mean loop.csv?"),
    (("metrics", "none/loop.csv"), "none/loop.csv: No such file or directory\n"),
    (("metrics", "weg.csv", "--u", "weg", "--y", "y"), "no column 'weg', the columns are: Weg, y; did you mean 'Weg'?"),
    (("metrics", "loop.csv", "--u", "y"), "the input and the output are both the column y: name them by --u and --y"),
    (("simulate", "loop.csv", "law.json"), "the model stands before the record: hysim simulate law.json loop.csv"),
    (("simulate", "law.json", "weg.csv"), "no column is called u, the columns are: Weg, y; name it by --u"),
    (("identify", "law.json", "--model", "line"), "law.json is a model, which hysim simulate, control, page and"),
    (("columns", "law.json"), "and c take, and hysim compare --model"),
    (
        ("c", "loop.csv", "--out", "a.c"),
        "not hold a model of hysim: Expecting value: line 1 column 1 (char 0); hysim identify --out makes",
    ),
    (("simulate", "line", "loop.csv"), "write a model of it by hysim identify --out line.json"),
    (("identify", "loop.csv", "--model", "weg.csv"), "the file weg.csv is no model: give the name of a family"),
    (("identify", "loop.csv", "--model", "line", "--out", "law"), "models are JSON: call the file .json, got law"),
    (("identify", "loop.csv", "--model", "line", "--sample-time", "1ms"), "number without a unit, got '1ms'"),
    (("identify", "loop.csv", "--model", "line", "--seed", "1.5"), "expected a whole number, got '1.5'"),
    (("plot", "loop.csv", "--kind", "forc", "--out", "f.svg"), "at least 3 reversal curves from different levels"),
    (("sweep", "study.toml"), "the rows are kept in a database: give --out study.sqlite"),
    (("example", "loop.csv"), "loop.csv is there already: give another name, as in hysim example mine.csv"),
)


def test_the_only_column_of_a_file_is_the_input_of_a_simulation(run, tmp_path):
    (tmp_path / "inputs.txt").write_text("1\n3\n")
    assert run("simulate", "law.json", "inputs.txt") == (0, "u,y\n1.0,2.0\n3.0,6.0\n", "")
    assert run("simulate", "law.json", "inputs.txt", "--out", "-") == (0, "u,y\n1.0,2.0\n3.0,6.0\n", "")
    assert '"y": [' in run("simulate", "law.json", "inputs.txt", "--json", "--out", "out.csv")[1]
    assert (tmp_path / "out.csv").read_text() == "u,y\n1.0,2.0\n3.0,6.0\n"


def test_the_nearest_name_is_found_whatever_the_spelling():
    assert suggestion("BoucWen", ["line", "bouc-wen"]) == "did you mean bouc-wen?"
    assert suggestion("zzz", ["line", "bouc-wen"]) == ""
