# failure_error: an exception with a text, caught by the enclosing `try`.


def operate(x):
    if x < 0:
        return x
    raise ValueError("not negative")


def main():
    total = 0
    for i in range(1000000):
        try:
            value = operate(i)
        except ValueError:
            value = i + 1
        total = (total + value) % 1000003
    print(total)


main()
