# mandelbrot: float arithmetic in local variables, in the innermost of three loops.


def escape_time(cr, ci, limit):
    zr = zi = 0.0
    n = 0
    while n != limit and zr * zr + zi * zi <= 4.0:
        zr, zi = zr * zr - zi * zi + cr, 2.0 * zr * zi + ci
        n += 1
    return n


def mandelbrot(size, limit):
    inside = steps = 0
    for y in range(size):
        ci = 2.0 * y / size - 1.0
        for x in range(size):
            n = escape_time(2.0 * x / size - 1.5, ci, limit)
            steps += n
            if n == limit:
                inside += 1
    print(inside, steps)


mandelbrot(800, 50)
