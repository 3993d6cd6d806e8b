# nqueens: building and walking short lists that share their tails.


def is_safe(row, placed):
    distance = 1
    while placed:
        other, placed = placed
        if other == row or other == row + distance or other == row - distance:
            return False
        distance += 1
    return True


def place_queens(size, column, placed, solutions):
    if column == size:
        return (placed, solutions)
    for row in range(size):
        if is_safe(row, placed):
            solutions = place_queens(size, column + 1, (row, placed), solutions)
    return solutions


def weigh(placed):
    weight = column = 0
    while placed:
        row, placed = placed
        column += 1
        weight += column * row
    return weight


def nqueens(size):
    solutions = place_queens(size, 0, None, None)
    count = checksum = 0
    while solutions:
        placed, solutions = solutions
        checksum = (checksum * 31 + weigh(placed)) % 1000003
        count += 1
    print(count, checksum)


for size in range(7, 12):
    nqueens(size)
nqueens(11)
