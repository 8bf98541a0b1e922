"""The only home of the compiler: cached kernels, and laws called by address from inside them.

Compiling costs some seconds once for each installation; the result is kept beside the environment
(or in the user's cache folder where that is read-only), that of each file under a hash of all that it
may hold (`ground.sources`), so that a stale kernel never runs and an edit elsewhere compiles nothing anew.
"""

from __future__ import annotations

import atexit
import errno
import functools
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.core.imputils import impl_ret_borrowed
from numba.core.runtime.nrtdynmod import _meminfo_struct_type
from numba.experimental import structref
from numba.experimental.structref import StructRefProxy, define_proxy
from numba.extending import intrinsic, lower_getattr_generic

from ground.sources import ROOT, hash_of

__all__ = [
    "ADVANCE",
    "BEGIN",
    "FORCE",
    "StructRefProxy",
    "StructType",
    "advance_law",
    "begin_law",
    "cache_folder",
    "call_advance",
    "call_begin",
    "call_force",
    "compiled",
    "define_proxy",
    "force_law",
    "inlined",
    "is_warm",
    "kept_under",
    "leaf",
    "mark_warm",
    "register",
    "released",
]

VARIABLE = "NUMBA_CACHE_DIR"

F = TypeVar("F", bound=Callable[..., Any])

_POINTER = types.CPointer(types.float64)
_DATA = 3  # which member of what holds a bundle points to it
# force(p, s, z, v): parameters, memory, sinkage, sinkage rate -> force on the reference face
FORCE = types.float64(_POINTER, _POINTER, types.float64, types.float64)
# begin(p, s): at first touch, once s[SPEED] and s[MASS] are latched
BEGIN = types.void(_POINTER, _POINTER)
# advance(p, s, z, v, h): one accepted step of a law's own hidden states, in place
ADVANCE = types.void(_POINTER, _POINTER, types.float64, types.float64, types.float64)


class StructType(types.StructRef):  # type: ignore[misc]
    """Type of a bundle of arrays that kernels take as one pointer."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Forget literal values, as the compiler asks."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)


def register(kind: Any) -> Any:
    """Let kernels read the arrays of a bundle of this type by name, also those that do not count who holds them.

    Numba's own way asks what holds the bundle for its data by a call that only counting kernels may make.
    """

    @lower_getattr_generic(structref.register(kind))  # type: ignore[untyped-decorator]
    def read(context: Any, builder: Any, bundle: Any, value: Any, name: str) -> Any:
        info = cgutils.create_struct_proxy(bundle)(context, builder, value=value).meminfo
        place = builder.bitcast(info, _meminfo_struct_type.as_pointer())
        held = bundle.get_data_type()
        kept = context.data_model_manager[held].get_value_type().as_pointer()
        data = builder.bitcast(builder.load(cgutils.gep(builder, place, 0, _DATA)), kept)
        member = getattr(cgutils.create_struct_proxy(held)(context, builder, ref=data), name)
        return impl_ret_borrowed(context, builder, bundle.field_dict[name], member)

    return kind


def cache_folder() -> Path:
    """Folder of the compiled kernels of this installation, where nothing else is asked for."""
    local = Path(sys.prefix) / "var" / "rollover-kernels"
    if not os.access(sys.prefix, os.W_OK):
        local = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "rollover-kernels"
    return local


def kept_under(file: Path) -> str:
    """Name of the folder of a file's machine code: another one for other sources, another compiler, another Python."""
    return hash_of([file], _COMPILER)


@functools.cache
def _of_runs() -> str:
    """The same over all that compiles for a run; four milliseconds, and the sources of a process stay."""
    folders = (ROOT / "ground", ROOT / "rollover" / "kernels")
    return hash_of([file for folder in folders for file in sorted(folder.glob("*.py"))], _COMPILER)


_COMPILER = f"{numba.__version__} {sys.version}"
ROOM = 64 << 20  # bytes that the machine code of all kernels takes, and as much again


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def _kept_at() -> Path:
    """Where machine code is kept: the folder for it, or where that cannot be written one that goes with this process.

    That is said once; child processes are told by the same variable that a user may set.
    """
    given = config.CACHE_DIR
    folder = Path(given) if given else cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        if not any(folder.glob("warm*")) and shutil.disk_usage(folder).free < ROOM:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return folder
    except OSError as e:
        what = f"Kernels cannot be kept in {folder} ({e.strerror or e}) and are compiled anew at every start, some 25 s"
        print(f"{what}; {VARIABLE}=FOLDER names another place for them.", file=sys.stderr, flush=True)
    for left in Path(tempfile.gettempdir()).glob("rollover-kernels-*-*") if sys.platform != "win32" else ():
        with suppress(OSError, ValueError):
            if left.lstat().st_uid == os.getuid() and not _is_running(int(left.name.split("-")[2])):
                shutil.rmtree(left, ignore_errors=True)
    passing = tempfile.mkdtemp(prefix=f"rollover-kernels-{os.getpid()}-")
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    config.CACHE_DIR = os.environ[VARIABLE] = passing
    return Path(passing)


KEPT = _kept_at()


def is_warm(integrator: str = "exudyn") -> bool:
    """Whether a run of this integrator with kernels of these very sources has finished on this machine before."""
    return (KEPT / _warm(integrator)).exists()


def _warm(integrator: str) -> str:
    return f"warm-{integrator}-{_of_runs()}"


@contextmanager
def _own_cache(function: Callable[..., Any]) -> Iterator[None]:
    """By module: machine code asks for the one it was made in, and a file of effects is loaded under another name."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(KEPT / function.__module__ / kept_under(Path(function.__code__.co_filename)))
    try:
        yield
    finally:
        config.CACHE_DIR = before


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    """The compiler's, with one machine code for all values of a number.

    It would make another for every constant that a caller hands on, also for the 0 at which a caller's sum begins.
    """
    with _own_cache(function):
        made = numba.njit(error_model="numpy", cache=True, **options)(function)
    template = made.get_call_template

    def of_any_value(args: Any, named: Any) -> Any:
        return template(
            tuple(types.unliteral(kind) for kind in args), {name: types.unliteral(kind) for name, kind in named.items()}
        )

    made.get_call_template = of_any_value
    return made


def compiled(function: F) -> F:
    """Compile at the first call and keep the machine code on disk."""
    return _compiled(function)  # type: ignore[no-any-return]


def released(function: F) -> F:
    """The same as `compiled`, with Python's lock released while it runs: several may run at once, in threads."""
    return _compiled(function, nogil=True)  # type: ignore[no-any-return]


def leaf(function: F) -> F:
    """Compile a kernel without counting who holds its arrays, which costs more than most kernels do.

    It reads and writes arrays and bundles that it is handed, makes and returns none, and calls nothing that does. One
    array is copied into another number by number: as a slice it might be made anew on the way.
    Kernels call it. Called from Python it may be handed arrays and numbers, but no bundle: that would never be freed.
    """
    return _compiled(function, _nrt=False)  # type: ignore[no-any-return]


def inlined(function: F) -> F:
    """The same as `leaf`, laid out in each of its callers: for what is short, or asked again and again."""
    return _compiled(function, _nrt=False, forceinline=True)  # type: ignore[no-any-return]


def force_law(function: Callable[..., float]) -> Any:
    """Compile ``force(p, s, z, v) -> F`` of a ground law so that kernels can call it by address."""
    _check_takes(function, "force(p, s, z, v)")
    with _own_cache(function):
        return numba.cfunc(FORCE, cache=True, error_model="numpy")(function)


def advance_law(function: Callable[..., None]) -> Any:
    """Compile ``advance(p, s, z, v, h)`` of a law with hidden states of its own."""
    _check_takes(function, "advance(p, s, z, v, h)")
    with _own_cache(function):
        return numba.cfunc(ADVANCE, cache=True, error_model="numpy")(function)


def begin_law(function: Callable[..., None]) -> Any:
    """Compile ``begin(p, s)``: what a law works out once for each touch."""
    _check_takes(function, "begin(p, s)")
    with _own_cache(function):
        return numba.cfunc(BEGIN, cache=True, error_model="numpy")(function)


def _check_takes(function: Callable[..., Any], form: str) -> None:
    """Refuse a function of another number of arguments, before the compiler does so at length. Raises ``TypeError``."""
    code = function.__code__
    if code.co_argcount != form.count(",") + 1 or code.co_kwonlyargcount or code.co_flags & 0x0C:  # *args, **kwargs
        got = ", ".join(code.co_varnames[: code.co_argcount])
        raise TypeError(f"arguments of another number, got {function.__name__}({got}); {form} is needed")


def mark_warm(integrator: str = "exudyn") -> None:
    """Note that an integrator's kernels have been compiled; where nothing can be written the next run compiles anew."""
    with suppress(OSError):
        KEPT.mkdir(parents=True, exist_ok=True)
        (KEPT / _warm(integrator)).touch()


def _by_address(signature: Any) -> Any:
    @intrinsic  # type: ignore[untyped-decorator]
    def call(typingctx: Any, address: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind = ir.FunctionType(
                context.get_value_type(signature.return_type), [context.get_value_type(a) for a in signature.args]
            )
            pointer = builder.inttoptr(args[0], kind.as_pointer())
            values = [builder.extract_value(args[1], i) for i in range(len(signature.args))]
            result = builder.call(pointer, values)
            return context.get_dummy_value() if signature.return_type == types.void else result

        return signature.return_type(types.intp, types.Tuple(signature.args)), codegen

    return call


call_force = _by_address(FORCE)
call_begin = _by_address(BEGIN)
call_advance = _by_address(ADVANCE)
