"""Values of programs that Python has no type for.

Other values are those of Python: NIL is None, T is True, integers of any size are int, ratios Fraction, floats float,
strings str. Lists are lists, vectors are tuples; vectors of bytes are bytes, and those of floats alone arrays of the
module `array`. A hash table is a Table, a dictionary. In the other direction False is NIL too, a dictionary becomes a property list, and an object with a
buffer of one dimension, such as an array of numpy, a vector of numbers.

An object of the program that has no counterpart here, such as a task or a structure, comes as a ProgramObject, which shows
what it is; a program does not take it back.
"""

from __future__ import annotations

from typing import Any, Dict, TypeVar


_N = TypeVar("_N", bound="_Named")


class _Named:
    __slots__ = ("name",)
    name: str

    def __init__(self, name: str) -> None:
        object.__setattr__(self, "name", name.upper())

    @classmethod
    def exact(cls: type[_N], name: str) -> _N:
        """Returns the one of exactly this name: Symbol.exact("Valve") is |Valve|."""
        made = object.__new__(cls)
        object.__setattr__(made, "name", name)
        return made

    def __setattr__(self, attribute: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} objects do not change")

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.name == self.name

    def __hash__(self) -> int:
        return hash((type(self).__name__, self.name))

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return type(self).exact, (self.name,)

    def __repr__(self) -> str:
        exact = "" if self.name == self.name.upper() else ".exact"
        return f"{type(self).__name__}{exact}({self.name!r})"


class Keyword(_Named):
    """A keyword: Keyword("on") is :ON."""

    __slots__ = ()

    def __init__(self, name: str) -> None:
        super().__init__(name.lstrip(":"))

    def __str__(self) -> str:
        return f":{self.name}"


class Symbol(_Named):
    """A symbol, as a program writes it: Symbol("valve") is VALVE, and Symbol("fleet::drive") that of another package."""

    __slots__ = ()

    def __str__(self) -> str:
        return self.name


class Character:
    """A character."""

    __slots__ = ("text",)

    def __init__(self, text: str) -> None:
        if len(text) != 1:
            raise ValueError(f"expected one character, not {text!r}")
        self.text = text

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Character) and other.text == self.text

    def __hash__(self) -> int:
        return hash((Character, self.text))

    def __repr__(self) -> str:
        return f"Character({self.text!r})"


class Dotted:
    """A list that does not end with NIL: its items, and what follows them."""

    __slots__ = ("items", "tail")

    def __init__(self, items: list[Any], tail: Any) -> None:
        self.items = items
        self.tail = tail

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Dotted) and (other.items, other.tail) == (self.items, self.tail)

    def __repr__(self) -> str:
        return f"Dotted({self.items!r}, {self.tail!r})"


class Table(Dict[Any, Any]):
    """A hash table of a program, which compares its keys by `equal`. Other dictionaries become property lists."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"Table({super().__repr__()})"


class Object:
    """An object of Python for a program to hold and hand back, without looking into it."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        return f"Object({self.value!r})"
