"""Parser of the command line: help with groups of commands and examples, and errors in one line."""

import argparse
import itertools
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import NoReturn

from hysim.cli import models
from hysim.cli.options import Command
from hysim.cli.shell.words import OTHER_NAMES, suggestion

BAD_INPUT = 2
"""Exit code for bad input."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose help ends with the names of models and with examples."""

    def __init__(self, **settings: object) -> None:
        super().__init__(formatter_class=_Help, **settings)  # type: ignore[arg-type]

    def error(self, message: str) -> NoReturn:
        """Print an error and the command with the help, and exit with 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {one_line(message)} (see {self.prog} --help)\n")

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Refuse a value that is none of the words of an option, with the one that may be meant."""
        if action.choices is not None and value not in action.choices:
            words = f"expected {', '.join(map(str, action.choices))}, got {str(value)!r}"
            near = suggestion(str(value), map(str, action.choices))
            raise argparse.ArgumentError(action, f"{words}: {near}" if near else words)

    def format_help(self) -> str:
        """The help; names of models are looked up here, since loading every family takes seconds."""
        command: Command | None = self.get_default("command")
        if command is not None:
            self.epilog = "\n\n".join(_ends(command))
        return super().format_help()


def _ends(command: Command) -> Iterable[str]:
    """Paragraphs at the end of a command's help."""
    if models.OPTIONS in command.options:
        yield f"Names of models: {', '.join(models.names_to_identify())}. A structure is a model in a file."
    elif models.FORMS in command.options:
        yield f"Names of models: {', '.join(models.names())}."
    if command.examples:
        yield "examples:\n" + textwrap.indent(command.examples.strip(), "  ")


class _Help(argparse.HelpFormatter):
    """Help whose paragraphs are filled, but for those with indented lines, which stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = [part if "\n  " in part else textwrap.fill(part, width) for part in text.split("\n\n")]
        return textwrap.indent("\n\n".join(paragraphs), indent)


def in_groups(groups: Mapping[str, Sequence[Command]]) -> str:
    """A paragraph for each group of commands: its title, and each command with its help."""
    width = max(len(command.name) for commands in groups.values() for command in commands)
    return "\n\n".join(
        "\n".join([f"{title}:", *(f"  {command.name:<{width}}  {command.help}" for command in commands)])
        for title, commands in groups.items()
    )


def unknown_options(words: Iterable[str], parser: argparse.ArgumentParser) -> list[str]:
    """Options among the words, as far as a word ``--``, that a command does not have, not even in full length."""
    known = parser._option_string_actions
    options = [word for word in itertools.takewhile(lambda word: word != "--", words) if word.startswith("--")]
    return [word for word in options if not any(each.startswith(word.partition("=")[0]) for each in known)]


def unexpected(words: Sequence[str], parser: argparse.ArgumentParser) -> str:
    """Message about the first argument that a command does not take, with the option that may be meant."""
    word, known = words[0], parser._option_string_actions
    if not word.startswith("-"):
        return f"unexpected argument {word!r}: names of files stand side by side, and each option takes one value"
    name = word.lstrip("-").partition("=")[0].replace("-", "_")
    meant = f"--{OTHER_NAMES.get(name, name).replace('_', '-')}"
    near = f"did you mean {meant}?" if meant in known else suggestion(word, known)
    return f"there is no option {word}" + (f": {near}" if near else "")


def one_line(text: str) -> str:
    """The text in one line; characters that a terminal would obey are printed as their codes."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in " ".join(text.split()))
