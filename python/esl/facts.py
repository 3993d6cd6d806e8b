"""Facts, inputs and properties of a program."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, AsyncIterator, Callable, Iterator, NamedTuple

from ._esl import Input
from .errors import Ended

if TYPE_CHECKING:
    from .engine import Engine


class FactChange(NamedTuple):
    """A change of a fact: whether it is in the database now, the fact, and the variables of the pattern."""

    is_there: bool
    fact: Any
    bindings: dict[str, Any]


class Subscription:
    """Something that calls a function until it is stopped, or until its `with` block ends."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop

    def stop(self) -> None:
        """Has the function called no more."""
        self._stop()

    def __enter__(self) -> "Subscription":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


class Facts:
    """The logical database of a program."""

    def __init__(self, engine: "Engine") -> None:
        self._engine = engine

    def assert_(self, fact: Any) -> Any:
        """Adds a fact, a text such as "(at rover ridge)" or a value. Returns whether it is new; an awaitable of that
        while the engine runs in a loop."""
        return self._engine._answer(self._engine._handle().assert_fact(fact))

    def retract(self, pattern: Any) -> Any:
        """Removes the facts that match a pattern. Returns how many there were, or an awaitable of that."""
        return self._engine._answer(self._engine._handle().retract(pattern))

    def query(self, query: Any) -> Any:
        """Returns the answers to a query such as "(at ?robot ?place)": dictionaries of its variables; or an awaitable
        of them."""
        return self._engine._answer(self._engine._handle().query(query))

    def set(self, name: str, value: Any, *arguments: Any) -> Any:
        """Gives a property of the program a value for these arguments. Returns whether that has changed it, or an
        awaitable of that."""
        return self._engine._answer(self._engine._handle().set(name, value, *arguments))

    def watch(self, pattern: Any, function: Callable[[FactChange], object]) -> Subscription:
        """Has a function called for each change of a fact that matches a pattern, on the thread on which the engine
        runs, which waits for it. The function cannot call the engine; a handle can be used."""

        def call(is_there: bool, fact: Any, bindings: dict[str, Any]) -> None:
            function(FactChange(is_there, fact, bindings))

        return Subscription(self._engine._machine.watch_facts(pattern, call).stop)

    async def changes(self, pattern: Any) -> AsyncIterator[FactChange]:
        """Yields the changes of facts that match a pattern, while the engine runs in this event loop:

            async for change in engine.facts.changes("(at ?robot ?place)"):
                print(change.bindings["place"], change.is_there)
        """
        # Imported here: it takes longer than all the rest of the package.
        import asyncio

        changes: asyncio.Queue[FactChange] = asyncio.Queue()
        # The engine runs on the thread of the loop.
        with self.watch(pattern, changes.put_nowait):
            while True:
                yield await changes.get()


class Inputs:
    """The inputs of a program, by their names: engine.inputs["scan"]. They keep the program waiting for signals. To
    iterate yields the names of those that the program has defined."""

    def __init__(self, engine: "Engine") -> None:
        self._engine = engine

    def __getitem__(self, name: str) -> Input:
        return self._engine._kept_handle().input(name)

    def __iter__(self) -> Iterator[str]:
        rows = self._engine.definitions()
        return iter([row.name.lower() for row in rows if row.kind == "input"])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name.lower() in set(self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _ipython_key_completions_(self) -> list[str]:
        try:
            return list(self)
        except (Ended, RuntimeError):
            return []
