# sort: the library's sort of a vector, with a user-defined predicate.
# (This row measures predicates, not keys; Python calls predicates through cmp_to_key.)

from functools import cmp_to_key

seed = 42


def next_random():
    global seed
    seed = seed * 16807 % 2147483647
    return seed


def checksum(numbers):
    total = 0
    for number in numbers:
        total = (total * 31 + number) % 1000003
    return total


def by_last_digits(a, b):
    a_key = a % 1000
    b_key = b % 1000
    if a_key == b_key:
        return b - a
    return a_key - b_key


def main():
    numbers = [next_random() for _ in range(250000)]
    numbers.sort(key=cmp_to_key(lambda a, b: a - b))
    print(checksum(numbers))
    numbers.sort(key=cmp_to_key(by_last_digits))
    print(checksum(numbers))
    numbers.sort(key=cmp_to_key(lambda a, b: b - a))
    print(checksum(numbers))


main()
