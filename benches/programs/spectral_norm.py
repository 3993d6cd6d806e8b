# spectral_norm: float arithmetic on vectors, with a call for every element of a matrix.

from math import floor, sqrt


def matrix_element(i, j):
    ij = i + j
    return 1.0 / (ij * (ij + 1) * 0.5 + i + 1)


def multiply_av(n, v, av):
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix_element(i, j) * v[j]
        av[i] = total


def multiply_atv(n, v, atv):
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix_element(j, i) * v[j]
        atv[i] = total


def multiply_atav(n, v, result, scratch):
    multiply_av(n, v, scratch)
    multiply_atv(n, scratch, result)


def spectral_norm(n):
    u = [1.0] * n
    v = [0.0] * n
    scratch = [0.0] * n
    for _ in range(10):
        multiply_atav(n, u, v, scratch)
        multiply_atav(n, v, u, scratch)
    vbv = vv = 0.0
    for i in range(n):
        vbv += u[i] * v[i]
        vv += v[i] * v[i]
    return sqrt(vbv / vv)


print(floor(spectral_norm(640) * 1000000000.0))
