"""No order of calls crashes the process, reads or writes memory that is not its own, or loses memory."""

from __future__ import annotations

import random
import shutil
from collections.abc import Sequence

import hypothesis.strategies as st
import pytest
from hypothesis import example, given, settings

from tests.fmu.native.wrapper import SANITIZERS, needs_compiler, program, run_program

pytestmark = needs_compiler
every_version = pytest.mark.parametrize("version", [2, 3])


def check(version: int, data: bytes, *arguments: str, flags: Sequence[str] = SANITIZERS) -> None:
    done = run_program(program(f"calls{version}", version, *flags), *arguments, data=data)
    assert done.returncode == 0, done.stderr.decode(errors="replace")


@every_version
def test_random_programs_under_the_sanitizers(version: int) -> None:
    generator = random.Random(version)
    for _ in range(100):
        check(version, generator.randbytes(generator.randrange(1, 4000)))


@every_version
@given(data=st.binary(max_size=600))
@example(data=b"")
@settings(deadline=None, max_examples=100)
def test_any_order_of_calls_under_the_sanitizers(version: int, data: bytes) -> None:
    check(version, data)


@every_version
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="no valgrind to look for leaks with")
def test_valgrind_finds_no_leak(version: int) -> None:
    data = random.Random(10 + version).randbytes(6000)
    check(version, data, "valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=all",
          flags=("-g", "-O1"))
