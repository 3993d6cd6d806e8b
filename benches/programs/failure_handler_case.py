# failure_handler_case: entering a `try` whose body raises nothing.


class Negative(Exception):
    pass


def operate(x):
    if x < 0:
        raise Negative(x)
    return x


def main():
    total = 0
    for i in range(5000000):
        try:
            value = operate(i)
        except Negative:
            value = 0
        total = (total + value) % 1000003
    print(total)


main()
