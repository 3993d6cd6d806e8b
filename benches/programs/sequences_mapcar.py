# sequences_mapcar: a function mapped over one list and over two.


def run(rounds, size):
    numbers = [size - 1 - i for i in range(size)]
    total = 0
    for turn in range(rounds):
        squares = list(map(lambda x: x * x, numbers))
        sums = list(map(lambda x, y: x + y + turn, numbers, squares))
        total = (total + sums[0]) % 1000003
    print(total)


run(6000, 1000)
