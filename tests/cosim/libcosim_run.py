"""Run an .ssp in libcosim and write its Real outputs at the end: the script of a process of its own.

usage: libcosim_run.py SYSTEM.ssp STEP_NANOSECONDS STEPS RESULT.json

Nothing of threadpitch is used here.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def run(ssp: str, step_nanoseconds: int, steps: int) -> dict[str, float]:
    """``component.variable`` -> value after so many steps."""
    from libcosimpy.CosimEnums import CosimVariableCausality, CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(ssp, step_nanoseconds)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    assert execution.step(steps), execution.status()
    found: dict[str, float] = {}
    for slave in execution.slave_infos():
        outputs = {variable.name.decode(): variable.reference for variable in execution.slave_variables(slave.index)
                   if variable.type == CosimVariableType.REAL.value
                   and variable.causality == CosimVariableCausality.OUTPUT.value}
        if outputs:
            values = observer.last_real_values(slave.index, list(outputs.values()))
            found |= {f"{slave.name.decode()}.{name}": value for name, value in zip(outputs, values, strict=True)}
    return found


if __name__ == "__main__":
    system, nanoseconds, count, result = sys.argv[1:]
    Path(result).write_text(json.dumps(run(system, int(nanoseconds), int(count))), encoding="utf-8")
