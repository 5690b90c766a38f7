"""Completion in bash that keeps a value with = or : in one piece, and no blank after an unfinished one."""

from __future__ import annotations

import os
import re
from typing import Any

from click.shell_completion import BashComplete, CompletionItem, add_completion_class, split_arg_string

SOURCE = r"""
%(complete_func)s() {
    local IFS=$'\n' cur=${COMP_WORDS[COMP_CWORD]} completion type value
    COMPREPLY=()
    for completion in $(env COMP_WORDS="${COMP_LINE:0:COMP_POINT}" %(complete_var)s=bash_complete "$1"); do
        type=${completion%%%%,*}
        value=${completion#*,}
        case $type in
            dir) compopt -o filenames; COMPREPLY+=($(compgen -d -- "$cur")) ;;
            file) compopt -o default; compopt -o filenames; COMPREPLY+=($(compgen -f -- "$cur")) ;;
            *) COMPREPLY+=("$value"); [[ $value == *[=:,] ]] && compopt -o nospace ;;
        esac
    done
    return 0
}

complete -o nosort -F %(complete_func)s %(prog_name)s
"""
"""bash splits a word at = and : and replaces the last part alone; the whole line shows the whole word."""


class Bash(BashComplete):
    """Completion in bash by the line before the cursor."""

    source_template = SOURCE

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the finished words of the line, and the one at the cursor."""
        line = os.environ["COMP_WORDS"]
        words = split_arg_string(line)[1:]
        self._begun = words.pop() if words and not line[-1].isspace() else ""
        return words, self._begun

    def format_completion(self, item: CompletionItem[Any]) -> str:
        """Return the type of a completion and, of its value, what bash replaces."""
        kept = re.match(r".*[=:]", self._begun)
        return f"{item.type},{str(item.value).removeprefix(kept[0] if kept else '')}"


def add_bash() -> None:
    """Complete in bash by this class instead of click's."""
    add_completion_class(Bash)
