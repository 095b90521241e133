"""FMUs from one declaration: a dataclass whose fields are the variables and whose methods are the equations."""

from threadpitch.fmu.build import FLAVORS, build_fmu, cached_fmu
from threadpitch.fmu.cache import cache_folder
from threadpitch.fmu.compiler import NO_COMPILER, PLATFORMS, available_compiler
from threadpitch.fmu.description import model_description
from threadpitch.fmu.description3 import model_description3
from threadpitch.fmu.documentation import html_page, markdown_table
from threadpitch.fmu.failure import BuildError
from threadpitch.fmu.model import Model, Scalar, read_model, scalars
from threadpitch.fmu.plain import PlainModule, plain_module
from threadpitch.fmu.python_fmu import build_python_fmu
from threadpitch.fmu.reference import refusal
from threadpitch.fmu.variable import (
    Clock,
    Experiment,
    ModelError,
    Terminal,
    Variable,
    input_,
    output,
    parameter,
    state,
)

__all__ = [
    "FLAVORS", "NO_COMPILER", "PLATFORMS", "BuildError", "Clock", "Experiment", "Model", "ModelError", "PlainModule",
    "Scalar", "Terminal", "Variable", "available_compiler", "build_fmu", "build_python_fmu", "cache_folder",
    "cached_fmu", "html_page", "input_", "markdown_table", "model_description", "model_description3", "output",
    "parameter", "plain_module", "read_model", "refusal", "scalars", "state",
]
