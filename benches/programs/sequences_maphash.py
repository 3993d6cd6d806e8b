# sequences_maphash: a function called with each entry of a dictionary, first to read, then to change it.


def run(rounds, size):
    table = {i * 7: i for i in range(size)}
    total = 0

    def add(key, value):
        nonlocal total
        total = (total + key + value) % 1000003

    def increment(key, value):
        table[key] = value + 1

    for _ in range(rounds):
        for key, value in table.items():
            add(key, value)
    for _ in range(rounds // 4):
        for key, value in table.items():
            increment(key, value)
    for value in table.values():
        total = (total + value) % 1000003
    print(total)


run(6000, 1000)
