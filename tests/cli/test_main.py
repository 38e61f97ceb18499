"""The command line as a whole: every command and option explained, errors in one form, fast start."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from places import ROOT
from tools import cli_options

from dlogen import __version__
from dlogen.cli.main import Command, cli
from dlogen.errors import ConfigError, DlogenError, FitError, InputError, UsageError

PAGE = (ROOT / "dlogen" / "cli" / "README.md").read_text(encoding="utf-8")


COMMANDS = cli_options.leaf_commands(cli)


def test_the_contract_names_these_commands() -> None:
    names = {words for words, _ in COMMANDS}
    assert {"fit", "synth", "eval", "compare", "info", "config show", "config schema", "formats", "extract"} <= names


@pytest.mark.parametrize(("words", "command"), COMMANDS, ids=[words for words, _ in COMMANDS])
def test_every_command_and_option_is_explained(words: str, command: click.Command) -> None:
    assert isinstance(command, Command), "all commands share -q, -v, --debug and the handling of errors"
    assert command.help and command.help.strip().splitlines()[0].endswith(".")
    assert command.epilog and "Example" in command.epilog, "help shows examples"
    for option in command.params:
        if isinstance(option, click.Option):
            assert option.help and option.help.strip(), f"{words} {option.opts} has no help"


@pytest.mark.parametrize(("words", "command"), COMMANDS, ids=[words for words, _ in COMMANDS])
def test_the_page_documents_every_command_and_option(words: str, command: click.Command) -> None:
    section = re.search(rf"^## `dlogen {words}`$.*?(?=^## )", PAGE + "\n## end", re.MULTILINE | re.DOTALL)
    assert section, f"the page has no section for dlogen {words}"
    for option in command.params:
        if isinstance(option, click.Option) and option.name not in cli_options.COMMON:
            for name in (*option.opts, *option.secondary_opts):
                assert f"`{name}" in section.group(0), f"dlogen {words} {name} is not in the page"


def test_the_page_is_what_the_script_writes() -> None:
    assert cli_options.generated(PAGE, COMMANDS) == PAGE, "run: python tests/tools/cli_options.py"


def test_the_script_writes_what_has_changed_and_nothing_else() -> None:
    begin, end = "<!-- generated: dlogen formats -->", "<!-- end -->"
    before, rest = PAGE.split(begin)
    assert cli_options.generated(f"{before}{begin} old {rest[rest.index(end) :]}", COMMANDS) == PAGE
    added = cli_options.generated("By hand.\n", [("fit", dict(COMMANDS)["fit"])])
    assert added.startswith("By hand.\n\n## `dlogen fit`\n\n<!-- generated: dlogen fit -->\n") and added.endswith(
        end + "\n"
    )


@pytest.mark.parametrize(("words", "command"), COMMANDS, ids=[words for words, _ in COMMANDS])
def test_examples_in_the_help_parse(words: str, command: click.Command) -> None:
    for line in re.findall(rf"^ +dlogen {words} ?(.*)$", command.epilog or "", re.MULTILINE):
        arguments = re.split(r"[|>&<;]", line)[0].split()
        context = click.Context(command, info_name=words, resilient_parsing=False)
        command.parse_args(context, arguments)


def test_version_and_unknown_commands() -> None:
    runner = CliRunner()
    assert runner.invoke(cli, ["--version"]).output.strip() == f"dlogen, version {__version__}"
    result = runner.invoke(cli, ["fitt"])
    assert result.exit_code == 2
    assert "Did you mean 'fit'?" in result.output


@pytest.mark.parametrize(
    ("error", "code"), [(FitError, 1), (DlogenError, 1), (InputError, 2), (ConfigError, 2), (UsageError, 2)]
)
def test_errors_become_one_message_and_an_exit_code(error: type[DlogenError], code: int) -> None:
    @click.command(cls=Command)
    def failing(console: object) -> None:
        raise error("it broke", "try this", path="cloud.ply", stage="sorting")

    result = CliRunner().invoke(failing, [])
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.splitlines() == ["error: cloud.ply: sorting: it broke", "hint: try this"]
    traceback = CliRunner().invoke(failing, ["--debug"])
    assert isinstance(traceback.exception, error)


def test_a_bug_is_reported_as_one_without_a_traceback() -> None:
    @click.command(cls=Command)
    def broken(console: object) -> None:
        raise IndexError("off by one")

    result = CliRunner().invoke(broken, [])
    assert result.exit_code == 1
    assert "bug" in result.stderr and "--debug" in result.stderr and "Traceback" not in result.stderr


def test_quiet_and_verbose_contradict() -> None:
    result = CliRunner().invoke(cli, ["formats", "-q", "-v"])
    assert result.exit_code == 2


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from dlogen.cli.main import cli\n"
        "try: cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'yaml', 'rich', 'trimesh', 'plyfile', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize("wanted", [None, "2"])
def test_one_thread_for_small_matrices_unless_the_user_wants_more(wanted: str | None) -> None:
    code = (
        "import os, sys; from dlogen.cli.main import main\n"
        "assert 'numpy' not in sys.modules\n"
        "sys.argv = ['dlogen', '--version']\n"
        "try: main()\n"
        "except SystemExit: print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    environment |= {} if wanted is None else {"OPENBLAS_NUM_THREADS": wanted}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == (wanted or "1")


def test_a_closed_pipe_is_no_error() -> None:
    command = f"{sys.executable} -m dlogen config schema | head -n 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shell_completion(shell: str) -> None:
    environment = {"_DLOGEN_COMPLETE": f"{shell}_source", "PATH": "/usr/bin:/bin"}
    script = Path(sys.executable).with_name("dlogen")
    done = subprocess.run([str(script)], env=environment, capture_output=True, text=True, check=False)
    assert "_DLOGEN_COMPLETE" in done.stdout


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
@pytest.mark.parametrize("buffered", [False, True])
def test_output_that_cannot_be_printed(buffered: bool) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    if not buffered:
        environment["PYTHONUNBUFFERED"] = "1"
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "dlogen", "formats"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment)
    assert result.returncode == 1
    assert result.stderr.startswith("error: cannot print: No space left on device\nhint: ")
    assert "Traceback" not in result.stderr and "ignored" not in result.stderr
