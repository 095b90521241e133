"""Between PythonFMU and a plain model: the functions of FMI over a table of variables.

This file is carried in every PythonFMU FMU, so it imports nothing of threadpitch and nothing but the standard library
and PythonFMU. The subclass below it in the FMU's script gives the model class and the tables.
"""

import json
from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any, ClassVar

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

LEAST, GREATEST = -(2**31), 2**31 - 1  # of fmi2Integer
INSTANTIATED, INITIALIZING, STEPPING = "instantiated", "initialization mode", "step mode"

# PythonFMU's library gives up its references to a slave that raised, and gives them up once more when the importer
# frees it. What is kept here twice survives both, so that a refusal does not crash the importer.
_refused: list[object] = []

Cell = tuple[Any, Any]  # (container, key): container[key] is the value
State = dict[str, Any]


class RefusalError(ValueError):
    """What was asked is against the model's declaration; PythonFMU turns it into fmi2Fatal with this message."""

    def __repr__(self) -> str:  # this is what PythonFMU's library logs
        return str(self)


class ModelSlave(Fmi2Slave):  # type: ignore[misc]  # PythonFMU ships no types
    """An FMU of a plain model. Subclasses set the tables, which the builder writes from the declaration."""

    model_class: ClassVar[Callable[[], Any]]
    content: ClassVar[str]  # hash of the model: a serialised state belongs to it
    # one row per value reference: (name, attribute, index or None, "float" | "int" | "bool", causality)
    variables: ClassVar[tuple[tuple[str, str, int | None, str, str], ...]]
    # attribute -> (least, greatest, {name: number} of choices or None, unit); None where there is no limit
    ranges: ClassVar[dict[str, tuple[float | None, float | None, dict[str, int] | None, str]]]
    errors: ClassVar[dict[int, str]]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.model = type(self).model_class()
        self.mode = INSTANTIATED
        self.stale = True  # something was set since ``initialize`` was evaluated
        self._fields: dict[str, Any] = vars(self.model)
        cells = [self._cell(attribute, index) for _, attribute, index, _, _ in self.variables]
        rows = list(enumerate(self.variables))
        # kind -> value reference -> where the value is
        self._readable = {wanted: {reference: cells[reference] for reference, row in rows if row[3] == wanted}
                          for wanted in ("float", "int", "bool")}
        self._settable = self._cells_of("parameter", "input")
        self._inputs = [(row[0], *cells[reference]) for reference, row in rows
                        if row[4] == "input" and row[3] == "float"]
        self._integers = [(row[0], *cells[reference]) for reference, row in rows
                          if row[3] == "int" and row[4] in ("output", "local")]
        changing = dict.fromkeys(row[1] for _, row in rows if row[4] in ("output", "local"))
        self._scalars = [name for name in changing if not isinstance(self._fields[name], list)]
        self._arrays = [self._fields[name] for name in changing if isinstance(self._fields[name], list)]

    def _cell(self, attribute: str, index: int | None) -> Cell:
        return (self._fields, attribute) if index is None else (self._fields[attribute], index)

    def _cells_of(self, *causalities: str) -> dict[str, dict[int, Cell]]:
        return {kind: {reference: cell for reference, cell in cells.items()
                       if self.variables[reference][4] in causalities}
                for kind, cells in self._readable.items()}

    # Life cycle -----------------------------------------------------------------------------------------------------

    def enter_initialization_mode(self) -> None:
        """From here on a get evaluates ``initialize``, so that loops between FMUs can be iterated."""
        self.mode = INITIALIZING

    def exit_initialization_mode(self) -> None:
        """Parameters within their range, ``check`` content, ``initialize`` evaluated; else fmi2Fatal with a reason."""
        if self.stale:
            complaint = self._initialize()
            if complaint is not None:
                self._refuse(complaint)
        self.mode = STEPPING
        self._settable = self._cells_of("input")

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One step of the model; on False (fmi2Discard) the state is the one before the step."""
        complaint = self._obstacle(step_size)
        if complaint is None:
            fields = self._fields
            scalars = [fields[name] for name in self._scalars]
            arrays = [values[:] for values in self._arrays]
            complaint = self._stepped(current_time, step_size)
            if complaint is None:
                return True
            fields.update(zip(self._scalars, scalars, strict=True))
            for values, before in zip(self._arrays, arrays, strict=True):
                values[:] = before
        self._say(f"the step from {current_time!r} s of {step_size!r} s is refused: {complaint}", Fmi2Status.discard)
        return False

    def _obstacle(self, step_size: float) -> str | None:
        """Why no step can be made from here, or None."""
        if self.mode != STEPPING:
            return f"the FMU is in {self.mode}; exit initialization mode first"
        if not (isfinite(step_size) and step_size > 0.0):
            return "the step size must be positive and finite"
        for name, container, key in self._inputs:
            if not isfinite(container[key]):
                return f"input {name} is {container[key]!r}; connect a finite value"
        return None

    def _stepped(self, current_time: float, step_size: float) -> str | None:
        """Step the model; why it failed, or None."""
        try:
            number = self.model.step(current_time, step_size)
        except (ArithmeticError, ValueError, IndexError) as error:
            return f"{type(error).__name__} in the model: {error}"
        if number != 0:
            return self._declared(number)
        return self._too_large()

    # Initialisation -------------------------------------------------------------------------------------------------

    def _initialize(self) -> str | None:
        """Check the parameters and evaluate ``initialize``; why it cannot be, or None."""
        complaint = self._complaint()
        if complaint is not None:
            return complaint
        try:
            number = self.model.check()
            if number != 0:
                return self._declared(number)
            self.model.initialize()
        except (ArithmeticError, ValueError, IndexError) as error:
            return f"{type(error).__name__} in the model's initialization: {error}; check the parameters"
        complaint = self._too_large()
        self.stale = complaint is not None
        return complaint

    def _complaint(self) -> str | None:
        """The first parameter that is outside its range, or input that is not finite."""
        for reference, (name, attribute, _, kind, causality) in enumerate(self.variables):
            if causality not in ("parameter", "input"):
                continue
            container, key = self._readable[kind][reference]
            value = container[key]
            if not isfinite(value):
                return f"{causality} {name} is {value!r}; set a finite value"
            if causality == "parameter" and attribute in self.ranges:
                least, greatest, choices, unit = self.ranges[attribute]
                if choices is not None and value not in choices.values():
                    listed = ", ".join(f"{number} = {choice}" for choice, number in choices.items())
                    return f"parameter {name} is {value}; set one of {listed}"
                if (least is not None and value < least) or (greatest is not None and value > greatest):
                    low = "-infinity" if least is None else repr(least)
                    high = "infinity" if greatest is None else repr(greatest)
                    return f"parameter {name} is {value!r}; set a value from {low} to {high}" + (
                        f" {unit}" if unit != "1" else "")
        return None

    def _declared(self, number: int) -> str:
        return self.errors.get(number, f"the model reports the undeclared error {number}")

    def _too_large(self) -> str | None:
        """FMI passes integers in 32 bits and PythonFMU would wrap larger ones silently."""
        for name, container, key in self._integers:
            if not LEAST <= container[key] <= GREATEST:
                return f"{name} is {container[key]}, beyond the 32 bits of an FMI integer"
        return None

    # Variables ------------------------------------------------------------------------------------------------------

    def _get(self, kind: str, references: Sequence[int]) -> list[Any]:
        if self.stale and self.mode == INITIALIZING:
            self._initialize()  # what prevents it is said when initialization mode is left
        cells = self._readable[kind]
        try:
            return [container[key] for container, key in [cells[reference] for reference in references]]
        except KeyError as error:
            self._refuse(f"value reference {error} is not of type {kind} in this FMU")
            raise

    def _set(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> None:
        cells = self._settable[kind]
        for reference, value in zip(references, values, strict=True):
            cell = cells.get(reference)
            if cell is None:
                self._refuse(self._not_settable(kind, reference))
            else:
                cell[0][cell[1]] = value
        self.stale = True

    def _not_settable(self, kind: str, reference: int) -> str:
        if reference not in self._readable[kind]:
            return f"value reference {reference} is not of type {kind} in this FMU"
        name, _, _, _, causality = self.variables[reference]
        if causality == "parameter":
            return f"parameter {name} is fixed in {self.mode}; set it before initialization ends, or reset the FMU"
        return f"{name} is calculated by the model and cannot be set; set parameters and inputs"

    def get_real(self, vrs: Sequence[int]) -> list[Any]:
        """fmi2GetReal."""
        return self._get("float", vrs)

    def get_integer(self, vrs: Sequence[int]) -> list[Any]:
        """fmi2GetInteger."""
        return self._get("int", vrs)

    def get_boolean(self, vrs: Sequence[int]) -> list[Any]:
        """fmi2GetBoolean."""
        return self._get("bool", vrs)

    def set_real(self, vrs: Sequence[int], values: Sequence[float]) -> None:
        """fmi2SetReal."""
        self._set("float", vrs, values)

    def set_integer(self, vrs: Sequence[int], values: Sequence[int]) -> None:
        """fmi2SetInteger."""
        self._set("int", vrs, values)

    def set_boolean(self, vrs: Sequence[int], values: Sequence[bool]) -> None:
        """fmi2SetBoolean."""
        self._set("bool", vrs, values)

    # FMU state ------------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> State:
        """Every field of the model, and where in its life the FMU is."""
        fields = {name: value[:] if isinstance(value, list) else value for name, value in self._fields.items()}
        return {"content": self.content, "mode": self.mode, "stale": self.stale, "fields": fields}

    def _set_fmu_state(self, state: State) -> None:
        if state["content"] != self.content:
            self._refuse("this FMU state belongs to another model, or to another build of this one")
        for name, value in state["fields"].items():
            if isinstance(value, list):
                self._fields[name][:] = value  # in place: the tables hold the list itself
            else:
                self._fields[name] = value
        self.mode, self.stale = state["mode"], state["stale"]
        self._settable = self._cells_of("input") if self.mode == STEPPING else self._cells_of("parameter", "input")

    @staticmethod
    def _fmu_state_to_bytes(state: State) -> bytes:
        """JSON; Python writes floats so that they read back bit for bit, infinities and NaN included."""
        return json.dumps(state).encode()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> State:
        try:
            read = json.loads(state.decode())
            return {"content": read["content"], "mode": read["mode"], "stale": read["stale"], "fields": read["fields"]}
        except (ValueError, TypeError, KeyError):
            return {"content": "unreadable"}  # refused when it is set: only there is a slave to say so

    # Messages -------------------------------------------------------------------------------------------------------

    def _text(self, message: str) -> str:
        # the logger takes a printf format, in which a percent sign would read arguments that are not there
        return f"{self.instance_name}: {message}".replace("%", "percent")

    def _say(self, message: str, status: Fmi2Status) -> None:
        self.log(self._text(message), status)

    def _refuse(self, message: str) -> None:
        # not logged as well: PythonFMU would call a Python importer's logger while the exception is set, and lose it
        _refused.extend((self, self, self.log_queue, self.log_queue, type(self), type(self)))
        raise RefusalError(self._text(message))
