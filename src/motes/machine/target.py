"""LLVM: this machine's processor, optimisation of text to object code, loading of object code."""

from __future__ import annotations

import ctypes
import sys
import threading
from functools import cache
from typing import Any

import llvmlite
from llvmlite import binding

from motes.machine.ahead import MARK, fetching_ahead
from motes.machine.module import EACH, ENTRY

LEVEL = 3


@cache
def processor() -> tuple[str, str, str]:
    """Triple, name and features of this processor; LLVM's name for machine code that runs here."""
    triple = binding.get_process_triple()
    if sys.platform == "win32":
        triple += "-elf"  # LLVM's loader knows that format best.
    features = binding.get_host_cpu_features().flatten()
    if "+avx512f" in features.split(","):
        # LLVM prefers half of the registers on some processors, from the days when full ones
        # lowered the clock.
        features += ",-prefer-256-bit"
    return triple, binding.get_host_cpu_name(), features


@cache
def has(feature: str) -> bool:
    """Whether the processor has a feature, by LLVM's name."""
    return f"+{feature}" in processor()[2].split(",")


def moves_lanes() -> bool:
    """Whether the processor permutes a vector's eight lanes by those of another."""
    return has("avx2")


def widest() -> int:
    """Numbers in single precision that one register holds, at least 8."""
    return 16 if has("avx512f") else 8


def identity() -> str:
    """What object code depends on besides its text."""
    return repr((llvmlite.__version__, binding.llvm_version_info, LEVEL, processor()))


@cache
def _begin() -> None:
    """Set LLVM up, and tell it where the few functions are that machine code calls."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    python = ctypes.pythonapi
    addresses = {
        "motes_malloc": ctypes.cast(python.PyMem_RawMalloc, ctypes.c_void_p).value,
        "motes_free": ctypes.cast(python.PyMem_RawFree, ctypes.c_void_p).value,
        "memset": _address("_memset_addr"),
        "memmove": _address("_memmove_addr"),
        "memcpy": _address("_memmove_addr"),
    }
    for name, address in addresses.items():
        binding.add_symbol(name, address)


def _address(name: str) -> int:
    import _ctypes

    found: int = getattr(_ctypes, name)
    return found


def _machine() -> Any:
    _begin()
    triple, name, features = processor()
    x86 = triple.startswith(("x86", "i386", "i686"))
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=name,
        features=features,
        opt=LEVEL,
        reloc="static" if x86 else "default",
        codemodel="jitdefault",
        jit=True,
    )


_here = threading.local()


def _tools() -> tuple[Any, Any]:
    """A target machine and a context of this thread."""
    if not hasattr(_here, "machine"):
        _here.machine = _machine()
    return _here.machine, binding.create_context()


def optimised(text: str) -> Any:
    """A module from its text, optimised."""
    machine, context = _tools()
    module = binding.parse_assembly(text, context)
    module.triple = processor()[0]
    module.data_layout = str(machine.target_data)
    module.verify()
    options = binding.create_pipeline_tuning_options(LEVEL)
    options.loop_vectorization = True
    options.slp_vectorization = False
    options.loop_interleaving = True
    options.loop_unrolling = True
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    if MARK in text:
        module = binding.parse_assembly(fetching_ahead(str(module)), context)
    return module


def object_code(text: str) -> bytes:
    """Object code of a module's text."""
    module = optimised(text)
    code: bytes = _tools()[0].emit_object(module)
    return code


_loading = threading.Lock()
_engines: list[Any] = []


def loaded(code: bytes) -> tuple[int, int]:
    """Addresses of the doors of a module's object code, which stays loaded; 0 for a missing one."""
    _begin()
    with _loading:
        engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _engines.append(engine)
        one, many = (int(engine.get_function_address(name)) for name in (ENTRY, EACH))
    return one, many
