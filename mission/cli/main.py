"""The `mission` program: one module beside this one per command, imported only when that command is used.

A command is a module whose name is also a function in it (with a trailing underscore where Python has taken the word,
as in `list_`). The first line of the module's docstring is what `mission --help` says of it; the function's docstring
is its help, and its typed parameters are its options. Adding a file is enough.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

GROUPS = {
    "Fly": ("run", "status", "pause", "resume", "step", "skip", "abort"),
    "Write and prove missions": ("validate", "graph", "prove", "test", "list", "schema"),
    "Look at what was flown": ("report", "replay"),
    "The rig": ("doctor", "simulate", "observe", "calibrate"),
}

HELP = """Fly wind-turbine blade inspections that are written as checked, proven state machines.

\b
Start here:
  mission run missions/v80_blade.yaml          fly it in the embedded simulator
  mission validate missions/v80_blade.yaml     check it, as a compiler would
  mission doctor                               is this machine ready
"""

EPILOG = """\b
Exit codes: 0 completed · 1 aborted or failed safely · 2 wrong command line or file
            3 refused before take-off · 130 interrupted
`mission COMMAND --help` explains a command, with examples."""

_FOLDER = Path(__file__).parent
_DOCSTRING = re.compile(r'\A\s*(?:"""|\'\'\')\s*(.+?)\s*(?:"""|\'\'\'|\n)')


def commands() -> dict[str, str]:
    """Every command and the line that explains it, read from the modules' text: nothing is imported."""
    found = {}
    for path in sorted(_FOLDER.glob("*.py")):
        text = path.read_text("utf-8")
        if path != Path(__file__) and re.search(rf"^def {path.stem}_?\(", text, re.MULTILINE):
            line = _DOCSTRING.match(text)
            found[path.stem.replace("_", "-")] = line.group(1).replace("`", "") if line else ""
    order = [name for names in GROUPS.values() for name in names]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def load(name: str) -> TyperCommand:
    """Import a command's module and make it a command."""
    stem = name.replace("-", "_")
    module = importlib.import_module(f"mission.cli.{stem}")
    function: Callable[..., Any] = getattr(module, stem, None) or getattr(module, f"{stem}_")
    settings = getattr(function, "context_settings", {})
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(name, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, **settings})(
        function
    )
    command = typer.main.get_command(app)
    assert isinstance(command, TyperCommand)
    return command


class CommandTable(TyperGroup):
    """The commands by group. Each is a stub with a line of help until it is asked for by name."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for name, text in commands().items():
            self.add_command(TyperCommand(name, help=text, rich_markup_mode=None))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in self.commands:
            self.add_command(load(args[0]))
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        grouped = {name for names in GROUPS.values() for name in names}
        rest = tuple(name for name in self.commands if name not in grouped)
        width = max(len(name) for name in self.commands)
        for title, names in (*GROUPS.items(), ("More", rest)):
            rows = [(name.ljust(width), self.commands[name].help or "") for name in names if name in self.commands]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


app = typer.Typer(
    cls=CommandTable,
    help=HELP,
    epilog=EPILOG,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"mission {version('blade-mission')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code. Every error is a line for a person; a traceback goes to a file."""
    from mission.cli.errors import explain

    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")  # there are none, and looking for them takes its time
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows only ASCII gets question marks, not an error
    command = typer.main.get_command(app)
    try:
        code = command.main(
            args=list(arguments) if arguments is not None else None, prog_name="mission", standalone_mode=False
        )
        sys.stdout.flush()
    except BaseException as error:
        return explain(error)
    return code if isinstance(code, int) else 0


if __name__ == "__main__":
    sys.exit(main())
