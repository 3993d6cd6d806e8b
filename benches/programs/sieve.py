# sieve: loops that read and write the elements of a long vector.


def sieve(limit, prime):
    count = total = 0
    for i in range(2, limit + 1):
        prime[i] = True
    for i in range(2, limit + 1):
        if prime[i]:
            count += 1
            total += i
            for j in range(i * i, limit + 1, i):
                prime[j] = False
    print(count, total)


def main():
    prime = [False] * 600001
    for i in range(40):
        sieve(500000 + i * 2500, prime)


main()
