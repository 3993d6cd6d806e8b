# failure_frames_call: failure_frames without the failures: calls a hundred deep.


def descend(depth, x):
    if depth == 0:
        if x < 0:
            raise ValueError("negative")
        return x
    return 1 + descend(depth - 1, x)


def main():
    total = 0
    for i in range(200000):
        total = (total + descend(100, i)) % 1000003
    print(total)


main()
