# A temporal network of 1,000 activities and 5,000 constraints: all windows from nothing, and again after each
# of 2,000 events, by changes only. Points happen in the order of their earliest times, a little late.
from collections import deque

seed = 42


def next_number(limit):
    global seed
    seed = (seed * 1103515245 + 12345) % 2147483648
    return (seed >> 8) % limit


class Network:
    def __init__(self, count):
        self.lows = [0] * count
        self.highs = [None] * count
        self.times = [None] * count
        self.times[0] = self.highs[0] = 0
        self.out = [[] for _ in range(count)]
        self.into = [[] for _ in range(count)]

    def add_edge(self, source, target, weight):
        self.out[source].append((target, weight))
        self.into[target].append((source, weight))

    def add_difference(self, source, target, low, high):
        if high is not None:
            self.add_edge(source, target, high)
        if low is not None:
            self.add_edge(target, source, -low)

    def raise_lows(self, queue):
        lows, into = self.lows, self.into
        waiting = set(queue)
        while queue:
            point = queue.popleft()
            waiting.discard(point)
            low = lows[point]
            for other, weight in into[point]:
                if low - weight > lows[other]:
                    if self.times[other] is not None:
                        return False
                    lows[other] = low - weight
                    if other not in waiting:
                        waiting.add(other)
                        queue.append(other)
        return True

    def lower_highs(self, queue):
        lows, highs, out = self.lows, self.highs, self.out
        waiting = set(queue)
        while queue:
            point = queue.popleft()
            waiting.discard(point)
            high = highs[point]
            for other, weight in out[point]:
                known = highs[other]
                if known is None or high + weight < known:
                    if self.times[other] is not None or high + weight < lows[other]:
                        return False
                    highs[other] = high + weight
                    if other not in waiting:
                        waiting.add(other)
                        queue.append(other)
        return True

    def solve(self):
        return self.raise_lows(deque(range(len(self.lows)))) and self.lower_highs(deque([0]))

    def happen(self, point, time):
        is_possible = True
        if time > self.lows[point]:
            self.lows[point] = time
            is_possible = self.raise_lows(deque([point]))
        if is_possible and (self.highs[point] is None or time < self.highs[point]):
            self.highs[point] = time
            is_possible = self.lower_highs(deque([point]))
        self.times[point] = time
        return is_possible


def build(count, constraints):
    network = Network(1 + 2 * count)
    for number in range(count):
        network.add_difference(1 + 2 * number, 2 + 2 * number, 1000, 3000)
        if number % 50 == 0:
            network.add_difference(0, 2 + 2 * number, 0, 20000 * count)
    for _ in range(constraints):
        a = next_number(count - 1)
        b = min(count - 1, a + 1 + next_number(20))
        kind = next_number(10)
        if kind == 0:
            network.add_difference(1 + 2 * a, 1 + 2 * b, 0, 1000000 * (b - a))
        elif kind <= 3:
            network.add_difference(1 + 2 * a, 1 + 2 * b, 0, None)
        else:
            network.add_difference(2 + 2 * a, 1 + 2 * b, 0, None)
    return network


def play(network):
    total = 0
    for point in sorted(range(1, len(network.lows)), key=lambda point: (network.lows[point], point)):
        late, high = network.lows[point] + 200, network.highs[point]
        time = late if high is None else min(late, high)
        if not network.happen(point, time):
            raise ValueError(f"point {point} cannot happen at {time}")
        total += time
    return total


for _ in range(3):
    network = build(1000, 5000)
    if not network.solve():
        raise ValueError("the network is inconsistent")
    print()
    print(play(network), end=" ")
