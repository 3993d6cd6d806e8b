# sequences_find_if: the first element that satisfies a predicate, directly or after a key function.


def find_if(predicate, items):
    for item in items:
        if predicate(item):
            return item
    return None


def find_if_key(predicate, items, key):
    for item in items:
        if predicate(key(item)):
            return item
    return None


def run(rounds, size):
    numbers = list(range(size))
    total = 0
    for turn in range(rounds):
        wanted = size - 1 - turn % 10
        total = (
            total
            + find_if(lambda x: x == wanted, numbers)
            + find_if_key(lambda x: x > wanted, numbers, lambda x: x + 1)
        ) % 1000003
    print(total)


run(9000, 1000)
