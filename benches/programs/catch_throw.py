# catch_throw: leaving nested calls early, to an inner or to an outer catch.


class Inner(Exception):
    def __init__(self, value):
        self.value = value


class Outer(Exception):
    def __init__(self, value):
        self.value = value


def descend(depth, n):
    if depth > 0:
        return 1 + descend(depth - 1, n)
    if n % 3 == 0:
        raise Inner(n)
    if n % 3 == 1:
        raise Outer(n)
    return n


def search_inner(n):
    try:
        result = descend(4, n)
    except Inner as thrown:
        result = thrown.value
    return 1 + result


def search_outer(n):
    try:
        return 2 + search_inner(n)
    except Outer as thrown:
        return thrown.value


def main():
    checksum = 0
    for n in range(1600000):
        checksum = (checksum * 3 + search_outer(n)) % 1000003
    print(checksum)


main()
