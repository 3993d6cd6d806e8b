"""Values of programs that Python has no type for.

Other values are those of Python: NIL is None, T is True, integers of any size are int, ratios Fraction, floats float,
strings str. Lists are lists, vectors are tuples; vectors of bytes are bytes, and those of floats alone arrays of the
module `array`. In the other direction False is NIL too, a dictionary becomes a property list, and an object with a
buffer, such as an array of numpy, a vector of numbers.
"""

from __future__ import annotations

from typing import Any


class _Named:
    __slots__ = ("name",)
    name: str

    def __init__(self, name: str) -> None:
        object.__setattr__(self, "name", name.upper())

    def __setattr__(self, attribute: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} objects do not change")

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.name == self.name  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((type(self).__name__, self.name))

    def __reduce__(self) -> tuple[type, tuple[str]]:
        return type(self), (self.name,)


class Keyword(_Named):
    """A keyword: Keyword("on") is :ON."""

    __slots__ = ()

    def __init__(self, name: str) -> None:
        super().__init__(name.lstrip(":"))

    def __repr__(self) -> str:
        return f"Keyword({self.name!r})"

    def __str__(self) -> str:
        return f":{self.name}"


class Symbol(_Named):
    """A symbol in the package ESL-USER: Symbol("valve") is VALVE."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"Symbol({self.name!r})"

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


class Object:
    """An object of Python for a program to hold and hand back, without looking into it."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        return f"Object({self.value!r})"
