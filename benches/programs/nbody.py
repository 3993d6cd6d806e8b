# nbody: float arithmetic on objects with mutable fields.

from math import floor, sqrt


class Body:
    __slots__ = ("x", "y", "z", "vx", "vy", "vz", "mass")

    def __init__(self, x, y, z, vx, vy, vz, mass):
        self.x = x
        self.y = y
        self.z = z
        self.vx = vx
        self.vy = vy
        self.vz = vz
        self.mass = mass


def make_bodies():
    pi_value = 3.141592653589793
    solar_mass = 4.0 * pi_value * pi_value
    days = 365.24
    return [
        Body(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, solar_mass),
        Body(
            4.84143144246472090,
            -1.16032004402742839,
            -0.103622044471123109,
            0.00166007664274403694 * days,
            0.00769901118419740425 * days,
            -0.0000690460016972063023 * days,
            0.000954791938424326609 * solar_mass,
        ),
        Body(
            8.34336671824457987,
            4.12479856412430479,
            -0.403523417114321381,
            -0.00276742510726411010 * days,
            0.00499852801234917238 * days,
            0.0000230417297573763929 * days,
            0.000285885980666130812 * solar_mass,
        ),
        Body(
            12.8943695621391310,
            -15.1111514016986312,
            -0.223307578892655734,
            0.00296460137564761618 * days,
            0.00237847173959480950 * days,
            -0.0000296589568540237556 * days,
            0.0000436624404335156298 * solar_mass,
        ),
        Body(
            15.3796971148509165,
            -25.9193146099879641,
            0.179258772950371181,
            0.00268067772490389322 * days,
            0.00162824170038242295 * days,
            -0.0000951592254519715870 * days,
            0.0000515138902046611451 * solar_mass,
        ),
    ]


def offset_momentum(bodies):
    sun = bodies[0]
    px = py = pz = 0.0
    for b in bodies:
        mass = b.mass
        px += b.vx * mass
        py += b.vy * mass
        pz += b.vz * mass
    sun.vx = -px / sun.mass
    sun.vy = -py / sun.mass
    sun.vz = -pz / sun.mass


def advance(bodies, dt):
    count = len(bodies)
    for i in range(count):
        a = bodies[i]
        ax, ay, az, a_mass = a.x, a.y, a.z, a.mass
        for j in range(i + 1, count):
            b = bodies[j]
            dx = ax - b.x
            dy = ay - b.y
            dz = az - b.z
            d2 = dx * dx + dy * dy + dz * dz
            magnitude = dt / (d2 * sqrt(d2))
            a_pull = b.mass * magnitude
            b_pull = a_mass * magnitude
            a.vx -= dx * a_pull
            a.vy -= dy * a_pull
            a.vz -= dz * a_pull
            b.vx += dx * b_pull
            b.vy += dy * b_pull
            b.vz += dz * b_pull
    for b in bodies:
        b.x += dt * b.vx
        b.y += dt * b.vy
        b.z += dt * b.vz


def energy(bodies):
    total = 0.0
    count = len(bodies)
    for i in range(count):
        a = bodies[i]
        vx, vy, vz = a.vx, a.vy, a.vz
        total += 0.5 * a.mass * (vx * vx + vy * vy + vz * vz)
        for j in range(i + 1, count):
            b = bodies[j]
            dx = a.x - b.x
            dy = a.y - b.y
            dz = a.z - b.z
            total -= a.mass * b.mass / sqrt(dx * dx + dy * dy + dz * dz)
    return total


def main():
    bodies = make_bodies()
    offset_momentum(bodies)
    print(floor(energy(bodies) * 1000000000.0))
    for _ in range(300000):
        advance(bodies, 0.01)
    print(floor(energy(bodies) * 1000000000.0))


main()
