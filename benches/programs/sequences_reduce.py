# sequences_reduce: lists folded with user-defined functions.

from functools import reduce


def run(rounds, size):
    numbers = [size - 1 - i for i in range(size)]
    vector = list(range(size))
    total = 0
    for turn in range(rounds):
        total = (
            total
            + reduce(lambda a, b: a + b, numbers)
            + reduce(lambda a, b: b if b > a else a, vector, turn)
        ) % 1000003
    print(total)


run(8000, 1000)
