# hash_tables: counting and looking up, with integers and then with strings as keys.

seed = 42


def next_random():
    global seed
    seed = seed * 16807 % 2147483647
    return seed


def count_integers(rounds):
    counts = {}
    for _ in range(rounds):
        key = 97 * (next_random() % 50000)
        counts[key] = counts.get(key, 0) + 1
    found = total = 0
    for i in range(rounds):
        count = counts.get(i)
        if count is not None:
            found += 1
            total += count
    print(found, total)


def count_strings(rounds):
    words = [f"word-{i}" for i in range(20000)]
    counts = {}
    for _ in range(rounds):
        word = words[next_random() % 10000]
        counts[word] = counts.get(word, 0) + 1
    total = 0
    for word in words:
        count = counts.get(word)
        if count is not None:
            total = (total * 31 + count) % 1000003
    print(total)


count_integers(4000000)
count_strings(4000000)
