# closures: creating them, calling them, and assigning to captured variables.


def make_adder(n):
    return lambda x: x + n


def make_accumulator(total):
    def accumulate(amount):
        nonlocal total
        total = (total + amount) % 1000003
        return total

    return accumulate


def compose(f, g):
    return lambda x: f(g(x))


def main():
    shared = make_accumulator(1)
    checksum = 0
    for i in range(1600000):
        own = make_accumulator(i)
        both = compose(make_adder(i), own)
        own(7)
        shared(both(11))
        checksum = (checksum + both(13)) % 1000003
    print(checksum, shared(0))


main()
