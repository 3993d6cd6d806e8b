# tak: calls with three arguments, one of them in tail position.


def tak(x, y, z):
    if y < x:
        return tak(tak(x - 1, y, z), tak(y - 1, z, x), tak(z - 1, x, y))
    return z


def main():
    total = 0
    for i in range(24):
        total += tak(24, 16, 8 + i % 2)
    print(total)


main()
