"""Solves planning problems by the engines of unified-planning.

Reads lines of JSON, {"engine": NAME or null, "domain": PDDL, "problem": PDDL, "timeout": SECONDS or null}, from standard
input, and answers each by a line: {"steps": [{"name", "arguments", "start", "duration"}...], "kind": KIND}, where times
are null in a plan without times and "after" lists the steps before each in a partial order; or {"error": KIND,
"message": TEXT}, where KIND is "not-installed", "unsolvable", "timeout" or "fault".
"""
import contextlib
import json
import sys


def seconds(time):
    return None if time is None else float(time)


def step(action, start=None, duration=None, after=None):
    return {
        "name": action.action.name,
        "arguments": [str(argument) for argument in action.actual_parameters],
        "start": seconds(start),
        "duration": seconds(duration),
        "after": after,
    }


def steps_of(plan):
    """Returns the kind of a plan and its steps."""
    from unified_planning.plans import PartialOrderPlan, SequentialPlan, TimeTriggeredPlan

    if isinstance(plan, TimeTriggeredPlan):
        return "time-triggered", [step(action, start, length) for start, action, length in plan.timed_actions]
    if isinstance(plan, SequentialPlan):
        return "sequential", [step(action) for action in plan.actions]
    if isinstance(plan, PartialOrderPlan):
        before = plan.get_adjacency_list
        actions = list(before)
        after = {index: [] for index in range(len(actions))}
        for index, action in enumerate(actions):
            for other in before[action]:
                after[actions.index(other)].append(index)
        return "partial-order", [step(action, after=after[index]) for index, action in enumerate(actions)]
    raise TypeError(f"plans of the type {type(plan).__name__} are not understood")


def solve(request):
    try:
        import unified_planning
        from unified_planning.engines import PlanGenerationResultStatus as Status
        from unified_planning.exceptions import (
            UPNoRequestedEngineAvailableException,
            UPNoSuitableEngineAvailableException,
        )
        from unified_planning.io import PDDLReader
        from unified_planning.shortcuts import OneshotPlanner, get_environment
    except ImportError as fault:
        return {"error": "not-installed", "message": str(fault)}
    get_environment().credits_stream = None
    problem = PDDLReader().parse_problem_string(request["domain"], request["problem"])
    try:
        if request["engine"]:
            planner = OneshotPlanner(name=request["engine"])
        else:
            planner = OneshotPlanner(problem_kind=problem.kind)
    except (
        ImportError,
        UPNoRequestedEngineAvailableException,
        UPNoSuitableEngineAvailableException,
    ) as fault:
        return {"error": "not-installed", "message": str(fault)}
    with planner:
        # Some engines know no timeout; the caller ends this process then.
        result = planner.solve(problem)
    if result.plan is None:
        kinds = {Status.TIMEOUT: "timeout", Status.INTERNAL_ERROR: "fault", Status.MEMOUT: "fault"}
        return {"error": kinds.get(result.status, "unsolvable"), "message": result.status.name}
    kind, steps = steps_of(result.plan)
    return {"kind": kind, "steps": steps}


def main():
    answers = sys.stdout
    for line in sys.stdin:
        if not line.strip():
            continue
        # Engines print what they like; only answers go out.
        with contextlib.redirect_stdout(sys.stderr):
            try:
                answer = solve(json.loads(line))
            except Exception as fault:  # The caller learns of any fault of an engine.
                answer = {"error": "fault", "message": f"{type(fault).__name__}: {fault}"}
        print(json.dumps(answer), file=answers, flush=True)


main()
