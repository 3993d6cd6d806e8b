"""Generates trees, runs them by py_trees, and prints the order of their leaves.

    py_trees_peer.py FOLDER COUNT SEED

writes FOLDER/N.xml for each tree, in the XML of BehaviorTree.CPP, and prints for each a line of its events: +NAME for a
leaf that begins, =NAME for a success, !NAME for a failure, -NAME for one that is halted; at last the status. A leaf NAME
takes, and comes to, the same at its n-th call in every implementation: see `plan`.

The nodes that mean the same: Sequence and Fallback are those with memory, ReactiveSequence and ReactiveFallback those
without; Inverter, ForceSuccess (FailureIsSuccess), ForceFailure (SuccessIsFailure), RetryUntilSuccessful (Retry) and
Repeat, whose counts are the same. Below a reactive node, these two are left out: py_trees waits a tick before each
attempt, so the reactive node looks at its other children in between. Parallels are left out too: py_trees ticks all their
children before it looks at any.
"""

import random
import sys

import py_trees
from py_trees.common import Status

MOST_TICKS = 300


def plan(name, call):
    """Returns how many ticks the call of a leaf takes after its first one, and whether it succeeds."""
    number = int(name[1:]) * 31 + call * 17
    number = number * 7919 % 1009
    return number % 4, number % 5 > 1


class Leaf(py_trees.behaviour.Behaviour):
    def __init__(self, name, events):
        super().__init__(name)
        self.events = events
        self.calls = 0

    def initialise(self):
        self.events.append("+" + self.name)
        self.calls += 1
        self.left, self.succeeds = plan(self.name, self.calls)

    def update(self):
        if self.left > 0:
            self.left -= 1
            return Status.RUNNING
        self.events.append(("=" if self.succeeds else "!") + self.name)
        return Status.SUCCESS if self.succeeds else Status.FAILURE

    def terminate(self, new_status):
        if new_status == Status.INVALID and self.status == Status.RUNNING:
            self.events.append("-" + self.name)


def generate(source, depth, leaves, is_reactive=False):
    """Returns a tree as a tuple: a leaf's name; or a tag, a number and children."""
    if depth == 0 or source.random() < 0.25:
        leaves.append("L%d" % (len(leaves) + 1))
        return leaves[-1]
    if source.random() < 0.35:
        tags = ["Inverter", "ForceSuccess", "ForceFailure"]
        tag = source.choice(tags if is_reactive else tags + ["RetryUntilSuccessful", "Repeat"])
        return tag, source.randint(1, 3), [generate(source, depth - 1, leaves, is_reactive)]
    tag = source.choice(["Sequence", "Fallback", "ReactiveSequence", "ReactiveFallback"])
    is_reactive = is_reactive or tag.startswith("Reactive")
    return tag, 0, [generate(source, depth - 1, leaves, is_reactive) for _ in range(source.randint(2, 4))]


def xml(tree):
    if isinstance(tree, str):
        return '<Action ID="%s"/>' % tree
    tag, number, children = tree
    attribute = {"RetryUntilSuccessful": ' num_attempts="%d"', "Repeat": ' num_cycles="%d"'}.get(tag, "")
    return "<%s%s>%s</%s>" % (tag, attribute % number if attribute else "", "".join(map(xml, children)), tag)


def build(tree, events):
    if isinstance(tree, str):
        return Leaf(tree, events)
    tag, number, children = tree
    children = [build(child, events) for child in children]
    if tag in ("Sequence", "ReactiveSequence"):
        return py_trees.composites.Sequence(tag, tag == "Sequence", children)
    if tag in ("Fallback", "ReactiveFallback"):
        return py_trees.composites.Selector(tag, tag == "Fallback", children)
    if tag == "RetryUntilSuccessful":
        return py_trees.decorators.Retry(tag, children[0], number)
    if tag == "Repeat":
        return py_trees.decorators.Repeat(tag, children[0], number)
    decorators = {
        "Inverter": py_trees.decorators.Inverter,
        "ForceSuccess": py_trees.decorators.FailureIsSuccess,
        "ForceFailure": py_trees.decorators.SuccessIsFailure,
    }
    return decorators[tag](tag, children[0])


def main():
    folder, count, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    source = random.Random(seed)
    for number in range(count):
        leaves = []
        tree = generate(source, 4, leaves)
        with open("%s/%d.xml" % (folder, number), "w") as file:
            file.write('<root BTCPP_format="4"><BehaviorTree ID="T">%s</BehaviorTree></root>' % xml(tree))
        events = []
        root = build(tree, events)
        for _ in range(MOST_TICKS):
            root.tick_once()
            if root.status != Status.RUNNING:
                break
        print(" ".join(events), root.status.name)


main()
