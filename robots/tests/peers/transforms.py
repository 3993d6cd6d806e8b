"""Writes `robots/tests/programs/transforms-table.esl`: random trees of frames, lookups in them, and the answers.

The answers are computed by products of matrices and by scipy's `Slerp`, apart from the library that they
test. Needs numpy and scipy: `python3 transforms.py > ../programs/transforms-table.esl`.
"""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

random = np.random.default_rng(20260101)
SECOND = 10**9


class Frame:
    """A frame, its parent, and the poses in it by their times in nanoseconds."""

    def __init__(self, name, parent, is_static, times):
        self.name, self.parent, self.is_static = name, parent, is_static
        self.times = times
        self.places = np.round(random.uniform(-5, 5, (len(times), 3)), 6)
        turns = Rotation.random(len(times), random_state=random).as_quat()
        self.turns = np.round(turns * random.choice([-1, 1], (len(times), 1)), 9)

    def at(self, time):
        """Returns the matrix at a time, or nothing."""
        matrix = np.eye(4)
        if self.is_static:
            matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(self.turns[0]).as_matrix(), self.places[0]
            return matrix
        if not self.times[0] <= time <= self.times[-1]:
            return None
        if len(self.times) == 1:
            turn = Rotation.from_quat(self.turns[0])
        else:
            # Relative to the first time, so that doubles are exact enough.
            turn = Slerp([t - self.times[0] for t in self.times], Rotation.from_quat(self.turns))(
                time - self.times[0]
            )
        place = [
            np.interp(time - self.times[0], [t - self.times[0] for t in self.times], column)
            for column in self.places.T
        ]
        matrix[:3, :3], matrix[:3, 3] = turn.as_matrix(), place
        return matrix

    def text(self):
        rows = zip(self.times, self.places, self.turns)
        rows = " ".join(f"({t} {numbers(p)} {numbers(q)})" for t, p, q in rows)
        return f'("{self.parent}" "{self.name}" {"t" if self.is_static else "nil"} ({rows}))'


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def tree(prefix, base):
    """Returns the frames of a random tree."""
    names, frames = [f"{prefix}0"], []
    for i in range(1, random.integers(4, 9)):
        is_static = random.random() < 0.25
        count = 1 if is_static else int(random.integers(1, 6)) if random.random() < 0.2 else 5
        begin = base + int(random.integers(0, SECOND // 2))
        steps = random.integers(SECOND // 100, SECOND, count)
        times = [int(t) for t in begin + np.cumsum(steps) - steps[0]]
        frames.append(Frame(f"{prefix}{i}", names[random.integers(len(names))], is_static, times))
        names.append(f"{prefix}{i}")
    return names, frames


def chain(frames, name):
    """Returns the frames from one of this name to its root, and the name of that."""
    links = []
    while name in frames:
        links.append(frames[name])
        name = frames[name].parent
    return links, name


def lookup(frames, target, source, time):
    """Returns the text of the answer to a lookup; nothing where causes compete."""
    up, top = chain(frames, source)
    down, other_top = chain(frames, target)
    if top != other_top:
        covered = time is None or all(link.at(time) is not None for link in up + down)
        return ":no-transform" if covered else None
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    if time is None:
        latest = [link.times[-1] for link in up + down if not link.is_static]
        time = min(latest) if latest else 0
    matrix = np.eye(4)
    for links, is_inverse in ((up, False), (down, True)):
        part = np.eye(4)
        for link in links:
            pose = link.at(time)
            if pose is None:
                return ":extrapolation"
            part = pose @ part
        matrix = (np.linalg.inv(part) if is_inverse else part) @ matrix
    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return f"({time} {numbers(np.round(matrix[:3, 3], 9))} {numbers(np.round(turn, 9))})"


print(";;;; Trees of frames, lookups in them and their answers: made by peers/transforms.py, with scipy.\n")
print("(defvar *trees*\n '(")
for number in range(4):
    base = 1_700_000_000 * SECOND + int(random.integers(0, SECOND))
    names, frames = tree("a", base)
    others, other_frames = tree("b", base)
    frames += other_frames[:2]
    everything = {frame.name: frame for frame in frames}
    names += [f.name for f in other_frames[:2]]
    lookups = []
    while len(lookups) < 24:
        target, source = random.choice(names, 2, replace=False)
        time = None
        if random.random() < 0.7:
            # Mostly inside; exactly at a transform now and then.
            time = base + int(random.integers(0, 3 * SECOND))
            if random.random() < 0.2:
                moving = [f for f in frames if not f.is_static]
                time = int(random.choice(random.choice(moving).times))
        answer = lookup(everything, target, source, time)
        if answer:
            lookups.append(f'("{target}" "{source}" {time or "nil"} {answer})')
    print("((" + "\n  ".join(f.text() for f in frames) + ")\n (" + "\n  ".join(lookups) + "))")
print("))")
