"""The compiled module holds nothing whose last bits depend on the machine.

The C library's sines and the fused multiply-add are what they would depend on; `docs/decisions/0019-same-bits.md`
says why neither is used.
"""

import re
import shutil
import subprocess

import pytest

from rover_gym import _core

# The C library's functions that may differ from one machine to the next.
C_FUNCTION = re.compile(
    rb"\s(a?(?:sin|cos|tan)h?|sincos|atan2|exp2?|exp10|expm1|log|log2|log10|log1p|pow|cbrt|hypot|fma|[tl]gamma(?:_r)?)f?\s"
)

# Fused multiply-adds and approximate reciprocals of x86-64 and AArch64.
INEXACT = re.compile(rb"vfn?m(add|sub)\w+|v?r(cp|sqrt)[ps]s|vr(cp|sqrt)(14|28)\w+|fn?m(add|sub)|fml[as]|fr(ecp|sqrt)e")


def objdump(what: str) -> bytes:
    """What the binutils tell about the compiled module."""
    command = shutil.which("objdump")
    if command is None:
        pytest.skip("objdump (of the binutils) is not installed")
    return subprocess.run([command, what, "--no-show-raw-insn", _core.__file__], check=True, capture_output=True).stdout


def test_the_module_calls_no_elementary_function_of_the_c_library() -> None:
    symbols = objdump("--dynamic-syms")
    assert b"memcpy" in symbols
    assert not set(C_FUNCTION.findall(symbols))


def test_the_module_has_no_fused_multiply_add() -> None:
    mnemonics = set(re.findall(rb"\t([a-z]\w+) ", objdump("--disassemble")))
    assert mnemonics & {b"mulsd", b"fmul"}
    assert not {name for name in mnemonics if INEXACT.fullmatch(name)}
