"""The command line: finds the commands and turns errors into messages and exit codes, here and nowhere else."""

from __future__ import annotations

import gc
import importlib
import os
import pkgutil
import sys
from typing import Any, NoReturn

import click

from dlogen._version import __version__
from dlogen.cli import commands
from dlogen.cli.console import Console
from dlogen.errors import DlogenError


class Command(click.Command):
    """A command with the options that all of them have: `-q`, `-v`, `--debug`. Passes a `Console` on as `console`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params += [
            click.Option(["-q", "--quiet"], is_flag=True, help="Print errors only."),
            click.Option(["-v", "--verbose"], is_flag=True, help="Print what every step does."),
            click.Option(["--debug"], is_flag=True, help="Show the traceback when something fails."),
        ]

    def invoke(self, ctx: click.Context) -> Any:
        """Take the common options out of the call before the command's function sees it."""
        quiet, verbose = ctx.params.pop("quiet"), ctx.params.pop("verbose")
        debug = ctx.params.pop("debug")
        if quiet and verbose:
            raise click.UsageError("-q and -v contradict each other", ctx)
        ctx.params["console"] = Console(-1 if quiet else 1 if verbose else 0)
        try:
            return super().invoke(ctx)
        except DlogenError as error:
            if debug:
                raise
            where = "".join(f"{part}: " for part in (error.path, error.stage) if part is not None)
            Console().error(where + error.message, error.hint)
            ctx.exit(error.exit_code)
        except KeyboardInterrupt:
            if debug:
                raise
            Console().error("interrupted")
            # As shells have it: 128 and the number of the signal.
            ctx.exit(130)
        except BrokenPipeError:
            raise
        except OSError as error:
            # Of files, `DlogenError`s are made where they are opened: this is standard output.
            if debug:
                raise
            what = "cannot print" if error.filename is None else str(error.filename)
            Console().error(f"{what}: {error.strerror or error}", "is there space where standard output leads to?")
            ctx.exit(1)
        except MemoryError:
            if debug:
                raise
            Console().error("not enough memory", "use fewer points: dlogen info shows how many there are")
            ctx.exit(1)
        except (ArithmeticError, LookupError, TypeError, ValueError, AssertionError, AttributeError) as error:
            if debug:
                raise
            Console().error(
                f"internal error: {type(error).__name__}: {error}",
                "this is a bug in dlogen; --debug shows where",
            )
            ctx.exit(1)


class CommandGroup(click.Group):
    """Imports a command's module only when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the modules in `dlogen.cli.commands`."""
        return sorted(info.name for info in pkgutil.iter_modules(commands.__path__) if not info.name.startswith("_"))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that module."""
        if cmd_name not in self.list_commands(ctx):
            return None
        command = importlib.import_module(f"dlogen.cli.commands.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click's, with the nearest name when there is no such command."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            import difflib

            near = difflib.get_close_matches(args[0], self.list_commands(ctx), n=1)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            ctx.fail(f"No such command '{args[0]}'.{hint}")
        return super().resolve_command(ctx, args)


@click.group(
    cls=CommandGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Examples:\n\n\b\n"
    "  dlogen fit cloud.ply\n"
    "  dlogen fit cloud.pcd -o models --set e_max=0.005\n"
    "  dlogen info cloud.ply\n",
)
@click.version_option(__version__, "--version", prog_name="dlogen")
def cli() -> None:
    """Kinematic multibody models of cables, hoses, ropes and wires from point clouds."""


def main() -> NoReturn:
    """Entry point of the `dlogen` script."""
    # Closed by the caller (`>&-`): there is nobody to write to.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: PTH123, SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: PTH123, SIM115
    # Read when numpy is loaded. Matrices are small here: threads take a tenth of a second to start, for nothing.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What is imported stays, and arrays are freed without it: looking for garbage that often is 5 % of a fit's time.
    gc.set_threshold(100_000, 20, 20)
    try:
        cli.main(prog_name="dlogen")
    except BrokenPipeError:
        # The reader of our stdout went away (`dlogen ... | head`): not an error of ours.
        sys.stderr.close()
        sys.exit(0)
    except SystemExit:
        _let_go_of_stdout()
        raise
    sys.exit(0)


def _let_go_of_stdout() -> None:
    """What could not be printed cannot be when Python ends either: it would make a traceback, and its own exit code."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
