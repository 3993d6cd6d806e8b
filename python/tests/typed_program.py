"""A program that uses the package, for checkers of types; it is not run."""

import asyncio
from typing import Optional

import esl

engine = esl.Engine(clock="virtual", allow=["read=/etc"], memory="64M", output=print)


@engine.function
def read_sensor(number: int) -> float:
    return 20 + 0.5 * number


@engine.operation
async def drive(metres: float, *, speed: float = 1.0) -> float:
    await asyncio.sleep(metres / speed)
    return metres


reading: float = read_sensor(3)
definitions: list[esl.Definition] = engine.definitions()
undone: Optional[int] = engine.undo_patch()
engine.inputs["scan"].signal(1.5, [2])


def tell(event: esl.Event) -> None:
    name: str = event.kind
    print(event.time + 1.0, name.upper())


with engine.observe(tell, kinds=["fails"]) as subscription:
    subscription.stop()

try:
    engine.eval("(survey)")
except esl.Failure as failure:
    place: Optional[esl.Place] = failure.frames[0].place
    print(failure.cause.lower(), place.line if place else 0)
except esl.CompileError as error:
    codes: list[str] = [diagnostic.code for diagnostic in error.diagnostics]


async def main() -> None:
    driven: float = await drive(3, speed=2)
    async with engine.running() as running:
        print(driven, await running.call("survey", esl.Keyword("ridge")))
        async for change in running.facts.changes("(at ?robot ?place)"):
            print(change.bindings["robot"], change.is_there)
