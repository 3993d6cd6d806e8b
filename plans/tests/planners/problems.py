"""Writes the temporal test problems of unified-planning, solved, as data of ESL.

    problems.py [NAME...]

Each line that begins with a parenthesis is a list (NAME FORMS FACTS GOALS PATTERNS ENTRIES CONSTRAINTS STEPS):
forms that define activities and properties; the facts at the beginning; forms that are true in the end;
patterns of all facts; entries and constraints of a plan for the events and deadlines of the problem, and for a
schedule; and the steps of the planner's plan, as `solve-with` returns them. Any other line names a problem that
no engine here solves, with the reason. Fluents that are not boolean are properties. An effect that needs a
computation is in the body of its activity, where `(touched FLUENT)` tells that the fluent changes. Activities
have the names of actions after `do-`.
"""
import sys
from fractions import Fraction

from unified_planning.model.scheduling import SchedulingProblem
from unified_planning.shortcuts import InstantaneousAction, OneshotPlanner, get_environment
from unified_planning.test.examples import get_example_problems

# Aries does not take durations that depend on arguments, and takes conditional effects for unconditional
# ones. In tamer's plan for `logistic`, two robots come to one place at the same moment, each on the condition
# that the other is not there. `None` stands for the plan that comes with the problem.
ENGINES = {
    "temporal_conditional": None,
    "robot_with_static_fluents_duration": "tamer",
    "robot_with_static_fluents_duration_timed_goals": "tamer",
    "logistic": None,
    "matchcellar_static_duration": "tamer",
}

# Neither engine takes continuous effects, or conditions in the middle of an action; tamer crashes for some.
UNSOLVED = {
    "timed_connected_locations": "conditions and effects in the middle of an action",
    "durative_continuous_example": "continuous effects",
    "robot_continuous": "continuous effects",
    "robot_conditional_effects": "continuous effects",
    "robot_non_linear_continuous_1": "continuous effects",
}


def number(value):
    return str(Fraction(value))


def call(name, arguments):
    return "(" + " ".join([name, *arguments]) + ")"


class Writer:
    def __init__(self, problem):
        self.problem = problem
        self.forms, self.entries, self.constraints, self.resources = [], [], [], {}

    def form(self, node):
        """Returns the form that computes an expression."""
        parts = [self.form(part) for part in node.args]
        if node.is_fluent_exp():
            reader = "holds" if node.fluent().type.is_bool_type() else "value-of"
            return call(reader, [f"'{node.fluent().name}", *parts])
        if node.is_parameter_exp():
            return "p-" + node.parameter().name
        if node.is_object_exp():
            return f"'{node.object().name}"
        if node.is_bool_constant():
            return "t" if node.bool_constant_value() else "nil"
        if node.is_constant():
            return number(node.constant_value())
        operators = {"AND": "and", "OR": "or", "NOT": "not", "EQUALS": "equal", "LT": "<", "LE": "<=", "PLUS": "+",
                     "MINUS": "-", "TIMES": "*", "DIV": "/"}
        return call(operators[node.node_type.name], parts)

    def term(self, node):
        """Returns the part of a fact for an argument or a value; None if that is computed."""
        if node.is_parameter_exp():
            return "p-" + node.parameter().name
        if node.is_object_exp():
            return node.object().name
        if node.is_constant() and not node.is_bool_constant():
            return number(node.constant_value())
        return None

    def fact(self, fluent, value=None):
        terms = [self.term(part) for part in fluent.args] + ([] if value is None else [self.term(value)])
        return None if None in terms else call(fluent.fluent().name, terms)

    def condition(self, node):
        """Returns a condition of an activity: a fact, or a test."""
        inner = node.args[0] if node.is_not() else node
        if inner.is_fluent_exp() and inner.fluent().type.is_bool_type() and self.fact(inner):
            return f"(not {self.fact(inner)})" if node.is_not() else self.fact(inner)
        return f"(test {self.form(node)})"

    def effect(self, effect):
        """Returns the facts of an effect, and the form for the body, or None."""
        value = effect.value
        if effect.is_assignment() and effect.condition.is_true():
            if value.is_bool_constant():
                fact = self.fact(effect.fluent)
                return ([fact] if value.bool_constant_value() else [f"(not {fact})"]), None
            if self.fact(effect.fluent, value):
                return [self.fact(effect.fluent, value)], None
        name, arguments = effect.fluent.fluent().name, [self.form(part) for part in effect.fluent.args]
        new = self.form(value)
        if not effect.is_assignment():
            old = call("value-of", [f"'{name}", *arguments])
            new = f"({'+' if effect.is_increase() else '-'} {old} {new})"
        if effect.fluent.fluent().type.is_bool_type():
            change = call("when", [new, f"(assert (list '{name} {' '.join(arguments)}))"])
        else:
            change = f"(assert (list '{name} {' '.join(arguments)} {new}))"
        return [f"(touched {name})"], f"(when {self.form(effect.condition)} {change})"

    def effects(self, effects):
        facts, bodies = [], []
        for effect in effects:
            more, body = self.effect(effect)
            facts += more
            bodies += [body] if body else []
        return facts, bodies

    def activity(self, name, parameters, duration, conditions, effects, bodies, requires=()):
        """Defines an activity. CONDITIONS and EFFECTS are lists by moment; bodies are pairs of seconds and a form."""
        lines = ["(sleep 0)"]
        now = "0"
        for time, form in bodies:
            lines += [f"(sleep (- {time} {now}))", form]
            now = time
        lines.append(f"(sleep (- {duration} {now}))")
        listed = [f"{moment} {' '.join(facts)}" for moment, facts in conditions.items() if facts]
        changed = [f"{moment} {' '.join(facts)}" for moment, facts in effects.items() if facts]
        self.forms.append(
            f"(defactivity do-{name} ({' '.join('p-' + parameter for parameter in parameters)})"
            f" :duration ({duration} {duration}) :requires ({' '.join(requires)})"
            f" :conditions ({' '.join(listed)}) :effects ({' '.join(changed)}) {' '.join(lines)})"
        )

    def conditions_of(self, action):
        conditions = {":at-start": [], ":over-all": [], ":at-end": []}
        for interval, nodes in action.conditions.items():
            lower, upper = interval.lower, interval.upper
            if lower.is_from_end():
                moment = ":at-end"
            else:
                moment = ":over-all" if upper.is_from_end() else ":at-start"
            for node in nodes:
                conditions[moment] += [self.condition(part) for part in (node.args if node.is_and() else [node])]
        return conditions

    def actions(self):
        for action in self.problem.actions:
            names = [parameter.name for parameter in action.parameters]
            if isinstance(action, InstantaneousAction):
                facts, bodies = self.effects(action.effects)
                needed = [self.condition(node) for node in action.preconditions]
                self.activity(action.name, names, "0", {":at-start": needed}, {":at-start": facts},
                              [("0", body) for body in bodies])
                continue
            duration = self.form(action.duration.lower)
            conditions = self.conditions_of(action)
            effects, timed = {":at-start": [], ":at-end": []}, []
            for timing, listed in action.effects.items():
                facts, bodies = self.effects(listed)
                effects[":at-end" if timing.is_from_end() else ":at-start"] += facts
                timed += [(duration if timing.is_from_end() else "0", body) for body in bodies]
                if bodies:
                    # It reads other fluents.
                    conditions[":at-end" if timing.is_from_end() else ":at-start"].append("(test t)")
            self.activity(action.name, names, duration, conditions, effects, timed)

    def events(self):
        """Activities at fixed times for timed effects and timed goals."""
        for timing, listed in self.problem.timed_effects.items():
            name = f"event-at-{timing.delay}"
            facts, bodies = self.effects(listed)
            self.activity(name, [], "0", {}, {":at-start": facts}, [("0", body) for body in bodies])
            self.entries.append((name, timing.delay))
        for interval, nodes in self.problem.timed_goals.items():
            name = f"goal-at-{interval.lower.delay}"
            self.activity(name, [], number(interval.upper.delay - interval.lower.delay),
                          {":over-all": [self.condition(node) for node in nodes]}, {}, [])
            self.entries.append((name, interval.lower.delay))

    def schedule(self, plan):
        """Activities and entries of a schedule. Effects that take and give back an amount are resources."""
        for fluent in self.problem.fluents:
            if fluent.type.is_int_type() and not fluent.arity:
                self.forms.append(f"(define-resource {fluent.name} :capacity {fluent.type.upper_bound})")
            elif fluent.type.is_int_type():
                for item in self.problem.objects(fluent.signature[0].type):
                    self.forms.append(f"(define-resource {item.name} :capacity {fluent.type.upper_bound})")
        values = {parameter.name: value for parameter, value in plan.assignment.items() if hasattr(parameter, "name")}

        def resource(effect):
            if effect.fluent.args:
                return str(values[effect.fluent.args[0].parameter().name])
            return effect.fluent.fluent().name

        for activity in self.problem.activities:
            requires, timed, ends = [], [], []
            for timing, listed in activity.effects.items():
                for effect in listed:
                    if effect.is_decrease():
                        requires.append(f"({resource(effect)} {effect.value})")
                    elif not effect.is_increase():
                        change = "assert" if effect.value.is_true() else "retract"
                        change = f"({change} '{self.fact(effect.fluent)})"
                        (ends if timing.is_from_end() else timed).append((number(timing.delay), change))
            duration = self.form(activity.duration.lower)
            ends = [(duration, change) for _, change in ends]
            self.activity(activity.name, [], duration, self.conditions_of(activity), {}, timed + ends, requires)
            start = plan.get(activity.start).constant_value()
            self.entries.append((activity.name, (number(start), "nil")))
        times = {}
        for timing, effect in self.problem.base_effects:
            times.setdefault((resource(effect), str(effect.value)), []).append(timing.delay)
        for (name, amount), (start, end) in times.items():
            self.activity(f"without-{name}", [], number(end - start), {}, {}, [], [f"({name} {amount})"])
            self.entries.append((f"without-{name}", start))
        for node in self.problem.base_constraints:
            assert node.is_le() and all(part.is_timing_exp() for part in node.args), node
            one, other = (part.timing().timepoint for part in node.args)
            self.constraints.append(f"(:before do-{one.container} do-{other.container})")

    def text(self, plan):
        facts, goals, steps = [], [], []
        if isinstance(self.problem, SchedulingProblem):
            self.schedule(plan)
        else:
            for fluent in self.problem.fluents:
                if not fluent.type.is_bool_type():
                    self.forms.append(f"(define-property {fluent.name} ({' '.join(p.name for p in fluent.signature)}))")
            for fluent, value in self.problem.initial_values.items():
                if not fluent.fluent().type.is_bool_type():
                    facts.append(self.fact(fluent, value))
                elif value.is_true():
                    facts.append(self.fact(fluent))
            self.actions()
            if hasattr(self.problem, "timed_effects"):
                self.events()
            goals = [self.form(goal) for goal in self.problem.goals]
            if self.problem.name == "htn-go-temporal":
                # Its tasks end there.
                goals = ["(member (value-of 'loc) '(l1 l2))"]
            plan = getattr(plan, "action_plan", plan)
            for start, action, duration in plan.timed_actions:
                arguments = " ".join(str(argument) for argument in action.actual_parameters)
                length = "nil" if duration is None else number(duration)
                steps.append(f"(do-{action.action.name} ({arguments}) {number(start)} {length})")
        entries = [f"(do-{name} {' '.join(time) if isinstance(time, tuple) else number(time) + ' ' + number(time)})"
                   for name, time in self.entries]
        patterns = [call(fluent.name, ["?"] * (fluent.arity + (not fluent.type.is_bool_type())))
                    for fluent in self.problem.fluents]
        lists = (self.forms, facts, goals, patterns, entries, self.constraints, steps)
        name = self.problem.name.replace(":", "-")
        return f"(\"{name}\" " + " ".join("(" + " ".join(part) + ")" for part in lists) + ")"


def main():
    get_environment().credits_stream = None
    problems = get_example_problems()
    for name, example in problems.items():
        kind = example.problem.kind
        if not (kind.has_continuous_time() or kind.has_discrete_time()) or (sys.argv[1:] and name not in sys.argv[1:]):
            continue
        if name in UNSOLVED:
            print(f"{name}: {UNSOLVED[name]}")
            continue
        example.problem.name = name
        engine = ENGINES.get(name, "aries")
        if engine is None:
            plan = example.valid_plans[0]
        else:
            with OneshotPlanner(name=engine) as planner:
                planner.skip_checks = True
                plan = planner.solve(example.problem).plan
        print(f"{name}: no plan" if plan is None else Writer(example.problem).text(plan), flush=True)


main()
