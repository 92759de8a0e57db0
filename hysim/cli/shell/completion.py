"""`hysim completion`: what bash, zsh or fish complete after the name of a command.

The scripts are written from the parsers of the commands, and complete the names of commands, options and models, and
values that are one of some words. Where any other value is expected, the shell completes the names of files.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from hysim.cli import models
from hysim.cli.options import Command

Parsers = Callable[[], Mapping[str, argparse.ArgumentParser]]
"""The parsers of all commands by their names."""


class _Option(NamedTuple):
    """An option, or an argument by its place, whose name is then empty."""

    name: str
    words: tuple[str, ...]
    takes_value: bool
    help: str


def command(parsers: Parsers) -> Command:
    """The command, which writes a script for the commands of `parsers`."""

    def run(options: argparse.Namespace) -> int:
        print(_SCRIPTS[options.shell](parsers()))
        return 0

    return Command(
        "completion",
        "write a script by which a shell completes commands and options",
        "Write a script for a shell to the standard output. For the running shell: source <(hysim completion bash), or "
        "hysim completion fish | source; for all: write it to a file where the shell looks for such scripts.",
        "shell bash|zsh|fish  shell",
        run,
        """
hysim completion bash
hysim completion fish
""",
    )


def _options(parser: argparse.ArgumentParser) -> Iterator[_Option]:
    names = models.names_to_identify()
    for action in parser._actions:
        help_ = " ".join((action.help or "").replace("%%", "%").split()).partition("; ")[0]
        is_model = action.metavar == "MODEL" and "--model" in action.option_strings
        words = tuple(map(str, action.choices or (names if is_model else ())))
        for name in action.option_strings or [""]:
            if name in ("", "-h") and not words:
                continue
            yield _Option(name, words, action.nargs != 0, help_)


def bash(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    """The script for bash."""
    cases = "\n".join(_bash_case(name, [*_options(parser)]) for name, parser in parsers.items())
    return f"""_hysim() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} name=${{COMP_WORDS[1]}} words=
  if ((COMP_CWORD == 1)); then
    COMPREPLY=($(compgen -W "{" ".join(parsers)} --help --version" -- "$current"))
    return
  fi
  case $name in
{cases}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _hysim hysim"""


def _bash_case(name: str, options: list[_Option]) -> str:
    values = [
        f"      {option.name}) words='{' '.join(option.words)}' ;;"
        for option in options
        if option.name and option.takes_value
    ]
    by_place = [word for option in options if not option.name for word in option.words]
    named = " ".join([*(option.name for option in options if option.name), *by_place])
    return "\n".join([f"    {name}) case $before in", *values, f"      *) words='{named}' ;;", "      esac ;;"])


def zsh(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    """The script for zsh."""
    names = " ".join(f"{name}\\:{_zsh_quoted(parser.description or '', 60)}" for name, parser in parsers.items())
    cases = "\n".join(
        "\n".join([f"    {name}) _arguments \\", *(f"      {_zsh_option(each)} \\" for each in _options(parser)),
                   "      '*:file:_files' ;;"])
        for name, parser in parsers.items()
    )  # fmt: skip
    return f"""#compdef hysim
_hysim() {{
  _arguments -C '1:command:(({names}))' '*::argument:->arguments'
  case $words[1] in
{cases}
  esac
}}
compdef _hysim hysim"""


def _zsh_option(option: _Option) -> str:
    if not option.name:
        return f"'1:word:({' '.join(option.words)})'"
    value = f":value:({' '.join(option.words)})" if option.words else ":value:_files" if option.takes_value else ""
    return f"'*{option.name}[{_zsh_quoted(option.help)}]{value}'"


def _zsh_quoted(text: str, longest: int = 200) -> str:
    plain = text[:longest].replace("'", "").replace('"', "").replace("\\", "")
    for sign in "[]():":
        plain = plain.replace(sign, f"\\{sign}")
    return plain


def fish(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    """The script for fish."""
    lines = []
    for name, parser in parsers.items():
        help_ = _fish_quoted((parser.description or "").partition(". ")[0])
        lines.append(f"complete -c hysim -n __fish_use_subcommand -f -a {name} -d {help_}")
        lines += [_fish_option(name, option) for option in _options(parser)]
    return "\n".join(lines)


def _fish_option(command: str, option: _Option) -> str:
    begin = f"complete -c hysim -n '__fish_seen_subcommand_from {command}'"
    words = _fish_quoted(" ".join(option.words))
    if not option.name:
        return f"{begin} -f -a {words}"
    value = f" -x -a {words}" if option.words else " -r -F" if option.takes_value else ""
    return f"{begin} -l {option.name.removeprefix('--')}{value} -d {_fish_quoted(option.help)}"


def _fish_quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


_SCRIPTS = {"bash": bash, "zsh": zsh, "fish": fish}
