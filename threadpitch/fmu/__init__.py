"""FMUs from one declaration: a dataclass whose fields are the variables and whose methods are the equations."""

from threadpitch.fmu.build import BuildError, build_fmu, build_python_fmu, cache_folder, cached_fmu
from threadpitch.fmu.description import model_description
from threadpitch.fmu.documentation import html_page, markdown_table
from threadpitch.fmu.model import Model, Scalar, read_model, scalars
from threadpitch.fmu.plain import PlainModule, plain_module
from threadpitch.fmu.variable import Experiment, ModelError, Variable, input_, output, parameter, state

__all__ = [
    "BuildError", "Experiment", "Model", "ModelError", "PlainModule", "Scalar", "Variable", "build_fmu",
    "build_python_fmu", "cache_folder", "cached_fmu", "html_page", "input_", "markdown_table", "model_description",
    "output", "parameter", "plain_module", "read_model", "scalars", "state",
]
