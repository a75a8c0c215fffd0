"""The command line: one file per command.

Data goes to stdout, everything else to stderr. Nothing heavy is imported before a command runs, and
no exception of any kind becomes a traceback.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

import click

from motes.errors import MotesError

COMMANDS = ("demo", "run", "render", "new", "check", "show", "info", "schema", "doctor", "ode")
"""Names of the commands, in the order of the help; `run` is the function `command` in run.py."""

INTERRUPTED = 130
INPUT_OUTPUT = 74
MEMORY = 75

EPILOG = """
\b
Start with:
  motes demo                      simulate and draw a scene into ./sprinkler/
  motes new fountain my.toml      copy a scene of the gallery, and change it
  motes run my.toml -o out        make its film

Completion of words with Tab: eval "$(_MOTES_COMPLETE=bash_source motes)"; for zsh and fish, write
zsh_source or fish_source.
"""


class _Commands(click.Group):
    """Commands that are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command = importlib.import_module(f"motes.cli.{name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from motes.errors import likely

            hint = likely(args[0], COMMANDS)
            if args[0].endswith((".toml", ".json")):
                hint = f" Did you mean `motes run {args[0]}`?"
            menu = ", ".join(COMMANDS)
            raise click.UsageError(f'no command "{args[0]}".{hint} There are: {menu}.', ctx)
        return super().resolve_command(ctx, args)


def _version(ctx: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        from importlib.metadata import version

        click.echo(f"motes {version('motes')}")
        ctx.exit()


@click.command(
    cls=_Commands, epilog=EPILOG, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version,
    help="Show the version.",
)  # fmt: skip
def group() -> None:
    """Particle systems: from a scene file to a film."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    Exit codes: 0 done, 1 the run failed, 2 the user's mistake, 3 a missing extra, 74 input or
    output, 75 memory, 130 interrupted.
    """
    sys.exit(_outcome(arguments))


def _outcome(arguments: Sequence[str] | None) -> int:
    """Run a command, say what went wrong in plain lines, and give the exit code."""
    try:
        given = list(sys.argv[1:] if arguments is None else arguments)
        code = group.main(given, "motes", standalone_mode=False)
        if sys.stdout is not None:  # None where it was closed before the start.
            sys.stdout.flush()
        return code or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.UsageError as error:
        _complain(error)
        return 2
    except (KeyboardInterrupt, click.Abort):
        click.echo("Stopped.", err=True)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader has seen enough; Python must not find the closed pipe once more at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MotesError as error:
        click.echo(str(error), err=True)
        return error.exit_code
    except MemoryError:
        click.echo("The memory is full. Emit fewer particles, or use a smaller size.", err=True)
        return MEMORY
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        click.echo(f"{where}{error.strerror or error}.", err=True)
        return INPUT_OUTPUT
    except Exception as error:
        if os.environ.get("MOTES_DEBUG"):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        click.echo(f"This is a fault of motes, not yours: {what}", err=True)
        click.echo("Please report it, with what MOTES_DEBUG=1 adds to this message.", err=True)
        return 1


def _complain(error: click.UsageError) -> None:
    """A mistake in the arguments in one line, and where to read on."""
    path = error.ctx.command_path if error.ctx is not None else "motes"
    click.echo(f"{path}: {error.format_message()}", err=True)
    click.echo(f"Read on with `{path} --help`.", err=True)
