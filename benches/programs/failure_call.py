# failure_call: the work common to all failure programs: a loop, a call, a sum.


def operate(x):
    if x < 0:
        raise ValueError("negative")
    return x


def main():
    total = 0
    for i in range(5000000):
        total = (total + operate(i)) % 1000003
    print(total)


main()
