# failure_frames: an exception raised a hundred calls inside the `try`.


class Broken(Exception):
    def __init__(self, x):
        self.x = x


def descend(depth, x):
    if depth == 0:
        raise Broken(x)
    return 1 + descend(depth - 1, x)


def main():
    total = 0
    for i in range(200000):
        try:
            value = descend(100, i)
        except Broken as broken:
            value = broken.x + 1
        total = (total + value) % 1000003
    print(total)


main()
