"""All variables of the lathe, the groove's memory among them: the same bits in both engines, in little memory."""

from __future__ import annotations

import functools

import pytest

from threadpitch import cosim, lathe
from threadpitch.cosim.block import WORD, Blocks
from threadpitch.cosim.csv_file import lines
from threadpitch.fmu import available_compiler


@pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")
def test_what_does_not_change_is_kept_once() -> None:
    locate = functools.partial(lathe.locate_fmu, "native")
    with cosim.read_system(lathe.find_system(lathe.DEFAULT_SYSTEM), locate=locate) as system:
        plain, kernel = (cosim.simulate(system, stop_time=0.8, record=["*"], engine=engine)
                         for engine in ("python", "kernel"))
    assert len(kernel) > 2000
    for name in ("time", *plain):
        assert kernel[name].tobytes() == plain[name].tobytes(), name
    table = kernel._table()
    assert isinstance(table, Blocks)
    words = sum(block.words.size for block in table)
    print(f"\n{len(kernel)} variables: {words * WORD / kernel.rows / 1000:.1f} KB of values per row, "
          f"{table.channels.row_words * WORD / 1000:.1f} KB where all change")
    assert words < 0.3 * kernel.rows * table.channels.row_words
    for block, other in zip(table, plain._table(), strict=True):
        chosen = slice(5, 200, 3)
        assert list(lines(block.some(chosen))) == list(lines(other.some(chosen).compact()))
