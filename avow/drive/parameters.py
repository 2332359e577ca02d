"""rclpy's parameters: declared with the values of the plan's file, and set by the node itself."""

from __future__ import annotations

import array
import enum
import math
import re
import types
from collections.abc import Callable, Iterator
from typing import Any

from .refusals import Strict

VALUES = tuple(f"{kind}_value" for kind in ("bool", "integer", "double", "string", "byte_array"))
VALUES += tuple(f"{kind}_array_value" for kind in ("bool", "integer", "double", "string"))
OWN = re.compile(r"use_sim_time\Z|start_type_description_service\Z|qos_overrides\.")
"""Parameters that every node of rclpy declares itself."""
NEAR = 1e-6
"""rclpy's relative tolerance in ranges of floats."""


class ParameterException(Exception):  # noqa: N818 - rclpy's name, as those below
    """Something is wrong with a parameter."""


class ParameterNotDeclaredException(ParameterException):
    """It is neither declared nor set."""


class ParameterAlreadyDeclaredException(ParameterException):
    """It is declared a second time."""


class ParameterUninitializedException(ParameterException):
    """It is declared with a type, and has no value."""


class InvalidParameterTypeException(ParameterException):
    """Its value is not of the declared type."""


class InvalidParameterValueException(ParameterException):
    """Its range or a callback rejects the value."""


EXCEPTIONS: dict[str, Any] = {kind.__name__: kind for kind in ParameterException.__subclasses__()}
EXCEPTIONS |= {"ParameterException": ParameterException}


class Parameter(Strict):
    _called = "rclpy.parameter.Parameter"

    class Type(enum.IntEnum):
        NOT_SET, BOOL, INTEGER, DOUBLE, STRING, BYTE_ARRAY, BOOL_ARRAY, INTEGER_ARRAY, DOUBLE_ARRAY, STRING_ARRAY = (
            range(10)
        )

    def __init__(self, name: str, type_: Any = None, value: Any = None) -> None:
        self.name, self.value = name, value
        many = isinstance(value, list | tuple | array.array)
        kinds = (bytes, bool, int, float, str) if many else (None, bool, int, float, str)
        number = 0
        if value is not None:
            items = list(value) if many else [value]
            fits = (n for n, kind in enumerate(kinds) if kind and all(isinstance(each, kind) for each in items))
            number = next(fits, -1)
            if number < 0:
                raise TypeError(f"{value!r} is not of a type that a parameter has")
            number += 5 if many else 0
        self.type_ = Parameter.Type(number if type_ is None else type_)
        if self.type_ != number:
            raise ValueError(f"{value!r} is not of the type {self.type_.name}")

    def get_parameter_value(self) -> Any:
        """A message rcl_interfaces/ParameterValue: the field of the parameter's type, defaults in the others."""
        fields = dict(zip(VALUES, (False, 0, 0.0, "", [], [], array.array("q"), array.array("d"), []), strict=True))
        if self.type_:
            code = {Parameter.Type.INTEGER_ARRAY: "q", Parameter.Type.DOUBLE_ARRAY: "d"}.get(self.type_)
            fields[VALUES[self.type_ - 1]] = array.array(code, self.value) if code else self.value
        return types.SimpleNamespace(type=int(self.type_), **fields)


class Parameters:
    """The parameters of a node."""

    def __init__(self) -> None:
        self._avow = Strict._driven
        self._avow_declared: dict[str, Parameter] = {}
        self._avow_described: dict[str, Any] = {}
        self._avow_asked: list[Callable[[list[Parameter]], Any]] = []
        self._avow_told: list[Callable[[list[Parameter]], Any]] = []

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        if name in self._avow_declared:
            raise ParameterAlreadyDeclaredException(name)
        typed = value if isinstance(value, Parameter.Type) else None
        value = None if typed is not None else value
        at = None if ignore_override else dict(flat(self._avow.params)).get(name)
        kind = Parameter(name, value=value).type_ if typed is None else typed
        made = Parameter(name, value=value if at is None else at)
        free = getattr(descriptor, "dynamic_typing", False) or kind is Parameter.Type.NOT_SET
        if at is not None and made.type_ is not kind and not free:
            text = kind.name if typed is not None else repr(value)
            mend = f": write {at}.0" if (kind, type(at)) == (Parameter.Type.DOUBLE, int) else ""
            raise InvalidParameterTypeException(f"the parameter {name} is declared as {text}, and set to {at!r}{mend}")
        self._avow_described[name] = descriptor
        result = self._avow_set([made], first=True)
        if not result.successful:
            raise InvalidParameterValueException(f"the parameter {name} is set to {made.value!r}: {result.reason}")
        return made

    def declare_parameters(self, namespace: str, parameters: Any, ignore_override: bool = False) -> list[Parameter]:
        prefix = f"{namespace}." if namespace else ""
        rest = {"ignore_override": ignore_override}
        return [self.declare_parameter(f"{prefix}{name}", *more, **rest) for name, *more in parameters]

    def has_parameter(self, name: str) -> bool:
        return name in self._avow_declared

    def get_parameter(self, name: str) -> Parameter:
        if name not in self._avow_declared:
            raise ParameterNotDeclaredException(name)
        return self._avow_declared[name]

    def get_parameters(self, names: list[str]) -> list[Parameter]:
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Any = None) -> Parameter:
        return self._avow_declared.get(name) or alternative_value or Parameter(name)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[Any]:
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> Any:
        for parameter in parameter_list:
            self.get_parameter(parameter.name)
        return self._avow_set(parameter_list)

    def add_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        self._avow_asked.insert(0, callback)

    def remove_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        self._avow_asked.remove(callback)

    def add_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        self._avow_told.insert(0, callback)

    def _avow_set(self, given: list[Parameter], *, first: bool = False) -> Any:
        """The result of setting all of them or none. `first`: they are being declared."""
        made = self._avow.classes.get("rcl_interfaces/SetParametersResult", types.SimpleNamespace)
        for parameter in given:
            wrong = self._avow_wrong(parameter, self._avow_described.get(parameter.name), first)
            if wrong:
                return made(successful=False, reason=f"{parameter.name}: {wrong}")
        for callback in self._avow_asked:
            result = callback(given)
            if not result.successful:
                return result
        self._avow_declared.update({parameter.name: parameter for parameter in given})
        for callback in self._avow_told:
            callback(given)
        return made(successful=True, reason="")

    def _avow_wrong(self, parameter: Parameter, descriptor: Any, first: bool) -> str:
        """Why its type or its descriptor does not allow the value."""
        before = self._avow_declared.get(parameter.name)
        free = getattr(descriptor, "dynamic_typing", False)
        if before is not None and before.value is not None and before.type_ is not parameter.type_ and not free:
            return f"Wrong parameter type, expected {before.type_.name}"
        if descriptor is None:
            return ""
        if descriptor.read_only and not first:
            return "it is read-only"
        value, whole = parameter.value, type(parameter.value) is int
        for limits in descriptor.integer_range if whole else descriptor.floating_point_range:
            if not whole and type(value) is not float:
                continue
            low, high = sorted((limits.from_value, limits.to_value))
            near = NEAR if not whole else 0
            if any(math.isclose(value, end, rel_tol=near) for end in (low, high)):
                continue
            stepped = low + (round((value - low) / limits.step) * limits.step if limits.step else value - low)
            if not low < value < high or not (not limits.step or math.isclose(stepped, value, rel_tol=near)):
                return f"{value!r} is not within [{low!r}, {high!r}] in steps of {limits.step!r}"
        return ""

    def _avow_all_declared(self) -> None:
        """Raises ValueError for a parameter that is set and not declared."""
        names = (name for name, _ in flat(self._avow.params))
        unknown = [name for name in names if name not in self._avow_declared and not OWN.match(name)]
        if unknown:
            known = ", ".join(sorted(self._avow_declared)) or "none"
            raise ValueError(f"the parameter {unknown[0]} is set, and the class declares {known}")


def flat(params: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Parameters by their dotted names."""
    for name, value in params.items():
        if isinstance(value, dict):
            yield from flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value
