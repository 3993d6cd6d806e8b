# sequences_sort: sorting with a user-defined predicate.

from functools import cmp_to_key

seed = 42


def next_random():
    global seed
    seed = seed * 16807 % 2147483647
    return seed


def sort_vectors(rounds, size):
    total = 0
    for _ in range(rounds):
        vector = [next_random() for _ in range(size)]
        vector.sort(key=cmp_to_key(lambda a, b: -1 if a > b else 1))
        total = (total + vector[size // 2]) % 1000003
    print(total)


sort_vectors(10, 50000)
