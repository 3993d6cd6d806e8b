# failure_handled: an exception caught by the enclosing `try`, which returns a result.


class Broken(Exception):
    def __init__(self, x):
        self.x = x


def operate(x):
    raise Broken(x)


def main():
    total = 0
    for i in range(1000000):
        try:
            value = operate(i)
        except Broken as broken:
            value = broken.x + 1
        total = (total + value) % 1000003
    print(total)


main()
