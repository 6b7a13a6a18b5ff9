"""Wrong options and commands, reported in one line."""

import sys
from typing import Any

import typer
from typer.core import TyperGroup

#: The base of all errors of usage, wherever Typer keeps it.
UsageError: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")


class WholeHelp(TyperGroup):
    """A group whose help gives the first paragraph of each command, wrapped instead of cut."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes the list of commands."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [
            (name, " ".join((command.help or "").split("\n\n")[0].split()))
            for name, command in commands
            if command is not None and not command.hidden
        ]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)


def group(text: str) -> typer.Typer:
    """A group of commands, whose help begins with this text; alone it prints its help."""
    return typer.Typer(cls=WholeHelp, rich_markup_mode=None, help=text, no_args_is_help=True)


class PlainUsage(WholeHelp):
    """The group of all commands, which ends with one line on standard error where its usage is wrong."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Runs the command of the arguments; see `TyperGroup.main`."""
        is_program = options.get("standalone_mode", True)
        options["standalone_mode"] = False
        if not is_program:
            return super().main(*args, **options)
        try:
            code = super().main(*args, **options)
        except typer.Abort:
            sys.exit(1)
        except UsageError as error:
            context = getattr(error, "ctx", None)
            if type(error).__name__ != "NoArgsIsHelpError":  # `rover model` has printed what is below it
                where = f" (help: {context.command_path} -h)" if context is not None else ""
                typer.echo(f"error: {' '.join(error.format_message().split())}{where}", err=True)
            sys.exit(error.exit_code)
        sys.exit(code or 0)
