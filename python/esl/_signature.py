"""Lambda lists of functions of Python, and the arguments of their calls."""

from __future__ import annotations

import inspect
import math
from typing import Any, Callable, NamedTuple, Optional

from .values import Keyword

# Value of an argument that a call has left out.
NOT_GIVEN = Keyword("%not-given")


class Parameter(NamedTuple):
    """A parameter of a function of Python, and the default for an argument that was not given."""

    name: str
    is_keyword: bool
    default: Any


class Signature(NamedTuple):
    """The parameters of a function, as a program and as Python have them."""

    lambda_list: str
    parameters: list[Parameter]
    # Whether the arguments of a call are those of the function as they come.
    is_plain: bool


def program_name(name: str) -> str:
    """Returns the name that a program has for one of Python: `max_speed` is MAX-SPEED."""
    return name.replace("_", "-")


def _text(default: Any) -> Optional[str]:
    """Returns a default as a program writes it; nothing if it is no simple value."""
    if default is None:
        return "nil"
    if default is True:
        return "t"
    if type(default) is int or (type(default) is float and math.isfinite(default)):
        return repr(default)
    if type(default) is str and default.isprintable():
        return '"' + default.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return None


def signature_of(function: Callable[..., Any]) -> Signature:
    """Returns the signature of a function: keyword-only parameters are keywords."""
    required: list[str] = []
    optional: list[str] = []
    keys: list[str] = []
    parameters: list[Parameter] = []
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise TypeError(
                f"a function of a program cannot have the parameter `*{parameter.name}`: name its arguments"
            )
        name, default = program_name(parameter.name), parameter.default
        is_keyword = parameter.kind is parameter.KEYWORD_ONLY
        if not is_keyword and default is parameter.empty:
            required.append(name)
        else:
            text = None if default is parameter.empty else _text(default)
            (keys if is_keyword else optional).append(f"({name} {text or NOT_GIVEN})")
        parameters.append(Parameter(parameter.name, is_keyword, default))
    parts = list(required)
    if optional:
        parts += ["&optional", *optional]
    if keys:
        parts += ["&key", *keys]
    return Signature(f"({' '.join(parts)})", parameters, not optional and not keys)


def arguments_of(signature: Signature, values: list[Any]) -> tuple[list[Any], dict[str, Any]]:
    """Returns the positional and the keyword arguments of a call."""
    positional: list[Any] = []
    keywords: dict[str, Any] = {}
    for parameter, value in zip(signature.parameters, values):
        if type(value) is Keyword and value == NOT_GIVEN:
            if parameter.default is inspect.Parameter.empty:
                raise TypeError(f"the keyword argument `{parameter.name}` is missing")
            value = parameter.default
        if parameter.is_keyword:
            keywords[parameter.name] = value
        else:
            positional.append(value)
    return positional, keywords
