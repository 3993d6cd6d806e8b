# failure_retried: an exception whose cause is repaired before the call is repeated.

broken = False


class Broken(Exception):
    def __init__(self, x):
        self.x = x


def operate(x):
    if broken:
        raise Broken(x)
    return x


def main():
    global broken
    total = 0
    for i in range(1000000):
        broken = True
        while True:
            try:
                value = operate(i)
                break
            except Broken:
                broken = False
        total = (total + value) % 1000003
    print(total)


main()
