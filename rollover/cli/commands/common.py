"""What all commands share: the application, exit status, options, and how wrong input is answered.

Exit status: 0 done, 1 the answer is no, 2 the input is wrong, 3 the simulation failed, 74 the machine failed (a disk
that is full, memory that is not there), 130 interrupted.
"""

from __future__ import annotations

import functools
import json
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import CommandFunctionType

# what takes long to import is imported by the command that needs it: `rollover --help` answers at once
from rollover.system.errors import Fault, InputError
from rollover.system.refusals import message_of, refused
from rollover.system.writing import working

if TYPE_CHECKING:
    from rollover.scenario import Scenario

THE_ANSWER_IS_NO, WRONG_INPUT, FAILED, INTERRUPTED, BUG = 1, 2, 3, 130, 70
MACHINE = 74  # as sysexits.h has it: an error of input or output

C = TypeVar("C", bound=Callable[..., None])

DONE, NO, WRONG = "0 done", "1 the answer is no", "2 the input is wrong: a line for each fault, nothing written"
BROKE = "3 a simulation failed: time, cause, last good state"
MACHINERY = "74 the machine failed (disk, memory): what stood there stays"


def manual(*examples: str, writes: str, status: str = "") -> str:
    """Lines below a command's options: how it is called, what it writes, and what its exit status says.

    `status` names what 1 and 3 mean where the command can end with them, parted by semicolons.
    """
    lines = [f"Example:  rollover {example}" for example in examples]
    words = "; ".join([*sorted([DONE, WRONG, *filter(None, status.split("; "))]), MACHINERY])
    return "\n\n".join([*lines, f"Writes:  {writes}", f"Exit status:  {words}."])


def _without_type(params: list[Any]) -> list[Any]:
    """Parameters, of which those that take no value show no type of one in a help."""
    for option in params:
        if getattr(option, "is_flag", False):
            option.metavar = ""
    return params


class Plain(TyperCommand):
    """A command in whose help a flag has no type, and whose numbers are numbers."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words; what is not a number passes every bound, and what is infinite those that are open."""
        rest = super().parse_args(ctx, args)
        for option in self.params:
            value = ctx.params.get(option.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise typer.BadParameter(f"{value} is not a finite number", ctx=ctx, param_hint=f"'{option.opts[0]}'")
        return rest

    def get_params(self, ctx: Any) -> Any:
        """Its parameters, `--help` among them."""
        return _without_type(super().get_params(ctx))


class Commands(typer.Typer):
    """An application whose commands are `Plain`."""

    def command(self, *args: Any, **kwargs: Any) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """Register a command."""
        return super().command(*args, **{"cls": Plain, **kwargs})


class Before(TyperGroup):
    """The commands; an option of `rollover` itself that follows one of them is told where it stands."""

    def get_params(self, ctx: Any) -> Any:
        """Its parameters, `--help` among them."""
        return _without_type(super().get_params(ctx))

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Call a command; a line of words that it does not understand is answered in one line."""
        more = {"complete_var": complete_var, "windows_expand_args": windows_expand_args, **extra}
        if not standalone_mode:
            return super().main(args, prog_name, standalone_mode=False, **more)
        if (odd := _no_text(sys.argv[1:] if args is None else args)) is not None:
            print(Fault(file="rollover", message=f"not text, got {odd!a}; characters are needed"), file=sys.stderr)
            sys.exit(WRONG_INPUT)
        try:
            status = super().main(args, prog_name, standalone_mode=False, **more)
        except typer.Abort:
            print("Interrupted.", file=sys.stderr)
            sys.exit(INTERRUPTED)
        except Exception as e:
            if not hasattr(e, "format_message"):
                raise
            if not e.format_message() or type(e).__name__ == "NoArgsIsHelpError":
                e.show()  # type: ignore[attr-defined]
            else:
                print(_usage(e), file=sys.stderr)
            sys.exit(WRONG_INPUT)
        sys.exit(status if isinstance(status, int) else 0)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first word names, of which the rest is for that command."""
        name, command, rest = super().resolve_command(ctx, args)
        known = {opt for option in command.params for opt in option.opts} if command else set()  # `prove` has its own
        own = {opt: o.metavar for o in self.params for opt in o.opts if o.metavar and opt not in known}
        for opt in (word.partition("=")[0] for word in rest):
            if opt in own:
                ctx.fail(f"{opt} stands before the command: rollover {opt} {own[opt]} {name} ...")
        return name, command, rest


def _no_text(words: Sequence[str]) -> str | None:
    """The first word that no system could have passed on: half a character by itself."""
    for word in words:
        try:
            os.fsencode(word)
        except UnicodeEncodeError:
            return word
    return None


def _usage(e: Any) -> Fault:
    """What is wrong with a command's words, in one line: the command, what is wrong, where it says what is right."""
    context = getattr(e, "ctx", None)
    path = context.command_path if context is not None else "rollover"
    message = " ".join(e.format_message().split())
    message = message if message.endswith("...") else message.removesuffix(".")
    return Fault(file=path, message=f"{message[:1].lower()}{message[1:]}; `{path} --help` tells what is allowed")


app = Commands(
    cls=Before,
    help="Vehicle rollover load studies: what the ground does to a ROPS.",
    epilog=manual("run side_overturn", "run --help", writes="each command into its own folder, whole or not at all.")
    + f" Some commands also end with {NO}, or with {BROKE}.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

AsJson = Annotated[bool, typer.Option("--json", help="Print the answer as JSON on standard output.")]
Setting = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Replace a value; may be repeated.")
]
Force = Annotated[bool, typer.Option("--force/--no-force", help="Replace another run's results.")]


def answering(command: C) -> C:
    """Turn wrong input, a fault of the machine and an interrupt into a line and their exit status.

    Any other exception is a bug and stays one. What the command held to write there is let go.
    """

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        said, status = "", 0
        try:
            with working() as work:
                try:
                    command(*args, **kwargs)
                    sys.stdout.flush()  # a full disk may be behind it
                except (OSError, MemoryError, BrokenExecutor) as e:
                    if (wrong := refused(e, work.targets)) is not None:
                        raise InputError(wrong) from None
                    target = next(reversed(work.targets), None)
                    said, status = message_of(e, target), MACHINE
        except InputError as e:
            said, status = str(e), WRONG_INPUT
        except KeyboardInterrupt:
            said, status = "Interrupted.", INTERRUPTED
        if status:  # not within `except`, which would keep what was being read
            print(said, file=sys.stderr)
            raise typer.Exit(status)

    return wrapped  # type: ignore[return-value]


def settings(given: list[str], option: str = "--set") -> dict[str, Any]:
    """Path -> value of each `--set PATH=VALUE`, or of what `option` reads likewise. Raises `InputError`."""
    from rollover.spec import document

    settings: dict[str, Any] = {}
    for text in given:
        path, value = document.parse_setting(text, option)
        if path in settings:
            raise InputError(Fault(file=option, path=path, message="given twice; once is allowed"))
        settings[path] = value
    return settings


def with_settings(chosen: Scenario, set_: list[str] | None) -> Scenario:
    """The scenario with the values of `--set`. Raises `InputError`."""
    return chosen.replaced(settings(set_), origin="--set") if set_ else chosen


def scenario_with(name: str, set_: list[str] | None) -> tuple[Path, Scenario]:
    """File of the scenario of that name, and the scenario with the values of `--set`. Raises `InputError`.

    Effects that nothing feels there are said.
    """
    from rollover import scenario
    from rollover.cli import console
    from rollover.spec import document

    path = document.find(name)
    chosen = with_settings(scenario.load(path), set_)
    for line in chosen.idle:
        console.say(f"{path}: {line}")
    return path, chosen


def hand_out(
    answer: Mapping[str, Any],
    page: str,
    folder: Path,
    names: tuple[str, str],
    *,
    as_json: bool,
    show: Callable[[], None],
) -> None:
    """Write an answer as JSON and its page to a folder, under two `names`, and print the JSON or `show` the answer."""
    from rollover.assessment import results

    with results.whole(folder) as part:
        results.write_json(part / names[0], answer)
        (part / names[1]).write_text(page, encoding="utf-8")
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        show()


def number_by_channel(text: str) -> tuple[str | None, float]:
    """Channel, None for all of them, and number of `NUMBER` or `CHANNEL=NUMBER`; NaN for what is no number."""
    channel, equals, number = text.rpartition("=")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    return channel if equals else None, value


def noises(given: list[str]) -> tuple[float, dict[str, float]]:
    """Share of the range for all, and 1 sigma for some channels. Raises `InputError`."""
    share, sigmas = 0.005, {}
    for text in given:
        channel, value = number_by_channel(text)
        if not 0.0 <= value < float("inf"):
            message = f"not a noise, got {text!r}; SHARE or CHANNEL=SIGMA, at least 0"
            raise InputError(Fault(file="--noise", message=message))
        if channel is None:
            share = value
        else:
            sigmas[channel] = value
    return share, sigmas
