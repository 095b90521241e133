"""Which FMI unit, display units and simple type a variable has: the same for every version of FMI."""

from __future__ import annotations

from dataclasses import dataclass

from threadpitch.fmu.model import Model
from threadpitch.fmu.variable import Variable
from threadpitch.units import Unit, conversion, unit

# SI unit -> quantity, spelled as in the Modelica Standard Library (Modelica.Units.SI), which FMI tools know
_QUANTITIES = {
    "m": "Length", "rad": "Angle", "s": "Time", "Hz": "Frequency", "1/s": "Frequency", "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration", "m/s": "Velocity", "m/s2": "Acceleration", "m/rad": "LeadPerAngle", "kg": "Mass",
    "kg.m2": "MomentOfInertia", "N": "Force", "N.m": "Torque", "N.m.s/rad": "RotationalDampingConstant",
    "N.m/rad": "RotationalSpringConstant", "N/m": "TranslationalSpringConstant",
    "N.s/m": "TranslationalDampingConstant", "N/m2": "Pressure", "W": "Power", "K": "Temperature",
    "1/K": "LinearExpansionCoefficient", "J": "Energy", "J/K": "HeatCapacity", "W/K": "ThermalConductance",
    "K/W": "ThermalResistance", "A": "Current", "V": "Voltage", "Ohm": "Resistance", "H": "Inductance",
    "F": "Capacitance", "C": "ElectricCharge", "Wb": "MagneticFlux", "T": "MagneticFluxDensity", "Pa": "Pressure",
    "Pa.s": "DynamicViscosity", "m2": "Area", "m3": "Volume", "m3/s": "VolumeFlowRate", "kg/s": "MassFlowRate",
    "kg/m3": "Density",
}
_LETTERS = {"%": "percent", "/": "_per_", ".": "_", "(": "", ")": "", " ": "_"}


@dataclass(frozen=True)
class SimpleType:
    """A type of real variables: quantity, unit and display unit; no name when the variable is dimensionless."""

    name: str
    quantity: str
    unit: str
    display: str | None


@dataclass(frozen=True)
class UnitUse:
    """A unit and the display units used with it: ``display value = factor * value + offset``."""

    unit: Unit
    displays: tuple[tuple[str, float, float], ...]  # (name, factor, offset)


def simple_type(variable: Variable) -> SimpleType | None:
    """The type of a float variable with a unit, e.g. ``Length_mm``; None for other variables."""
    if variable.kind != "float" or variable.unit not in _QUANTITIES:
        return None
    quantity = _QUANTITIES[variable.unit]
    shown = variable.display or variable.unit
    for letter, replacement in _LETTERS.items():
        shown = shown.replace(letter, replacement)
    return SimpleType(f"{quantity}_{shown}", quantity, variable.unit, variable.display)


def simple_types(model: Model) -> tuple[SimpleType, ...]:
    """The types that the model's variables use, by name."""
    found = {kind.name: kind for variable in model.variables if (kind := simple_type(variable)) is not None}
    return tuple(found[name] for name in sorted(found))


def unit_uses(model: Model) -> tuple[UnitUse, ...]:
    """The units of the model's float variables with their display units, by name."""
    found: dict[str, set[str]] = {}
    for variable in model.variables:
        if variable.kind == "float":
            displays = found.setdefault(variable.unit, set())
            if variable.display is not None:
                displays.add(variable.display)
    return tuple(
        UnitUse(unit(name), tuple((display, *conversion(name, display)) for display in sorted(found[name])))
        for name in sorted(found)
    )


def variability(variable: Variable) -> str:
    """FMI variability: parameters are fixed, floats continuous unless declared discrete, all others discrete."""
    if variable.causality == "parameter":
        return "fixed"
    return "continuous" if variable.kind == "float" and not variable.discrete else "discrete"


def has_start(variable: Variable) -> bool:
    """Whether the start value is given by the importer: parameters and inputs; the rest ``initialize`` calculates."""
    return variable.causality in ("parameter", "input")


def described(variable: Variable) -> str:
    """The description, with the meaning of every number of an int with choices."""
    if not variable.choices:
        return variable.description
    meanings = ", ".join(f"{number} = {name}" for name, number in variable.choices.items())
    return f"{variable.description} ({meanings})"
