"""Linking of kernels: a kernel called by others becomes part of them before machine code is made.

To numba each compiled function is a library of its own, with wrappers for calls from Python and
from C, optimised, and with machine code. Each caller includes that library and optimises it again,
level by level. Here a kernel that other kernels call stays intermediate code (LLVM IR). When Python
calls a kernel, all code that it needs is linked, optimised and turned into machine code once.

Only kernels that Python has called are kept on disk: their machine code contains all that they
call.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any

from llvmlite import binding as llvm
from numba.core import compiler, dispatcher, registry
from numba.core.codegen import JITCodeLibrary, RuntimeLinker
from numba.core.environment import Environment
from numba.core.errors import UnsupportedError

from albot_core.kernels.notice import Notice

_compiler: Any = compiler
_dispatcher: Any = dispatcher
_Environment: Any = Environment
_FunctionCompiler: Any = _dispatcher._FunctionCompiler
_notice = Notice()


class Kernel(registry.CPUDispatcher):
    """A compiled function, as Python calls it.

    Args:
        function: The function.
        options: The options of numba's `jit`.
    """

    def __init__(self, function: Any, locals: Any = None, targetoptions: Any = None) -> None:  # noqa: A002
        super().__init__(function, locals, targetoptions)
        self.linked = _LinkedKernel(function, locals, targetoptions)
        """The same function, as other kernels call it."""
        self._compiler = _KernelCompiler(self)

    # numba asks for these when another kernel calls this one: for its types, its code, and whether
    # it is being compiled, which shows a recursion.

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return the types of the arguments and of the result for arguments of these types."""
        return self.linked.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """Return the key by which numba's `get_function` finds the code for these types."""
        return self.linked.get_overload(sig)

    @property
    def is_compiled(self) -> bool:
        """Whether machine code for any types exists, in this process or on disk."""
        kept: Any = self._cache  # type: ignore[attr-defined]
        return bool(self.overloads or kept._cache_file._load_index())

    @property
    def is_compiling(self) -> Any:
        """Whether the function is being compiled."""
        return self.linked.is_compiling


class _LinkedKernel(registry.CPUDispatcher):
    """A compiled function, as other kernels call it."""

    def __init__(self, function: Any, locals: Any = None, targetoptions: Any = None) -> None:  # noqa: A002
        super().__init__(function, locals, targetoptions)
        self._compiler = _LinkedCompiler(
            function, self.targetdescr, targetoptions, self.locals, compiler.Compiler
        )

    def add_overload(self, cres: Any) -> None:
        """Keep the compiled code; Python cannot call it."""
        self.overloads[tuple(cres.signature.args)] = cres


class _LinkedCompiler(_FunctionCompiler):  # type: ignore[misc]
    """A compiler that makes only the intermediate code of a function."""

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        flags = _compiler.Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        context = self.targetdescr.target_context
        library = _LinkedLibrary(context.codegen(), self.py_func.__qualname__)
        compiled = _compiler.compile_extra(
            self.targetdescr.typing_context,
            context,
            self.py_func,
            args,
            return_type,
            flags,
            self.locals,
            library,
            self.pipeline_class,
        )
        library.exported = compiled.fndesc.llvm_func_name
        compiled = compiled._replace(entry_point=_Name())
        context.insert_user_function(compiled.entry_point, compiled.fndesc, [library])
        return compiled


class _Name:
    """The key by which a caller finds the code of a function that Python cannot call."""


class _KernelCompiler(_FunctionCompiler):  # type: ignore[misc]
    """A compiler of a kernel and of all its callees to machine code, with a Python wrapper."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__(
            kernel.py_func, kernel.targetdescr, kernel.targetoptions, kernel.locals, None
        )
        self._kernel = kernel

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        with _notice.compiling(), _garbage_left():
            wanted = return_type(*args) if return_type else tuple(args)
            self._kernel.linked.compile(wanted)
            _notice.give_if_due()
            return self._link(self._kernel.linked.overloads[tuple(args)])

    def _link(self, linked: Any) -> Any:
        # The code gets an environment (its constants) of its own. The linked function, loaded in
        # the same process, may have the same environment name, and the wrapper would find the
        # environment of that function.
        descriptor, context = copy(linked.fndesc), linked.target_context
        descriptor.env_name += ".python"
        environment = _Environment.from_fndesc(descriptor)
        library = context.codegen().create_library(descriptor.qualname)
        library.enable_object_caching()
        library.add_linking_library(linked.library)
        context.create_cpython_wrapper(
            library,
            descriptor,
            environment,
            linked.call_helper,
            release_gil=bool(self.targetoptions.get("nogil")),
        )
        compiled = linked._replace(
            library=library,
            entry_point=context.get_executable(library, descriptor, environment),
            fndesc=descriptor,
            environment=environment,
            metadata={},
        )
        for referenced in compiled._find_referenced_environments():
            library.codegen.set_env(referenced.env_name, referenced)
        return compiled


@contextmanager
def _garbage_left() -> Iterator[None]:
    """Suspend the garbage collector while a function is compiled.

    It would take a seventh of the time, and find little: most of a compiler's many objects are in
    use until the end.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class _LinkedLibrary(JITCodeLibrary):
    """The intermediate code of one function, with references to the code of its callees."""

    exported = ""
    """The function's name in the code."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)  # type: ignore[no-untyped-call]
        self._parts: dict[_LinkedLibrary, None] = {}
        self._others: dict[Any, None] = {}

    def add_linking_library(self, library: Any) -> None:
        """Record that this code needs another library, and all libraries that it needs."""
        if isinstance(library, _LinkedLibrary):
            self._parts |= library._parts | {library: None}
            self._others |= library._others
        else:
            library._ensure_finalized()
            self._others[library] = None
        self._reload_init.update(library._reload_init)

    def finalize(self) -> None:
        """Mark the library as finished; there is no machine code to make."""
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Return the code of this function and of all that it calls."""
        whole = self._final_module.clone()
        for part in self._parts:
            whole.link_in(part._final_module, preserve=True)
        for library in self._others:
            whole.link_in(library._get_module_for_linking(), preserve=True)
        # numba resolves such functions by name when it links, but not in code kept on disk: there
        # the call would jump to address 0.
        if any(each.name.startswith(RuntimeLinker.PREFIX) for each in whole.global_variables):
            raise UnsupportedError(f"{self.name}: a kernel calls itself by way of another one")
        for function in whole.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        return whole
